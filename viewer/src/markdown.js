// The little Markdown that reports are written in: tables, lists, paragraphs, links as text.

const plain = (text) => text.replace(/!\[.*?\]\(.*?\)/g, "").replace(/\[(.*?)\]\(.*?\)/g, "$1").replace(/[*`]+/g, "").trim();
const cells = (line) => line.split("|").slice(1, -1).map(plain);

function add(parent, kind, text) {
  const found = document.createElement(kind);
  if (text !== undefined) found.textContent = text;
  parent.append(found);
  return found;
}

// Sorts by a column, numbers as numbers.
function sort(body, column) {
  const key = (row) => { const t = row.cells[column].textContent, n = parseFloat(t.replaceAll(",", "")); return Number.isNaN(n) ? t : n; };
  const rows = [...body.rows], down = body.dataset.by === String(column);
  rows.sort((a, b) => (key(a) < key(b) ? -1 : key(a) > key(b) ? 1 : 0) * (down ? -1 : 1));
  body.dataset.by = down ? "" : column;
  body.append(...rows);
}

export function render(parent, lines, colours) {
  let table = null, list = null;
  for (const line of lines) {
    if (line.startsWith("|")) {
      if (/^\|[-|: ]+\|?$/.test(line)) continue;
      if (!table) {
        const whole = add(add(parent, "div"), "table");
        whole.parentElement.className = "scroll";
        table = { body: whole.createTBody() };
        const head = whole.createTHead().insertRow();
        const { body } = table;
        cells(line).forEach((text, k) => add(head, "th", text).addEventListener("click", () => sort(body, k)));
        continue;
      }
      const row = table.body.insertRow();
      for (const text of cells(line)) {
        const cell = row.insertCell();
        const colour = colours.get(text);
        if (colour) add(cell, "i").style.background = colour;
        cell.append(text);
      }
      continue;
    }
    table = null;
    if (line.startsWith("- ")) { list ??= add(parent, "ul"); add(list, "li", plain(line.slice(2))); continue; }
    list = null;
    if (plain(line)) add(parent, "p", plain(line));
  }
}
