// Rows of which only those in sight are in the page.
const HEIGHT = 26; // px of a row

export class Table {
  constructor(box, columns, onRow) {
    Object.assign(this, { box, columns, onRow, rows: [], by: null, down: false });
    [this.head, this.body] = box.querySelectorAll("thead, tbody");
    const line = document.createElement("tr");
    columns.forEach((column) => {
      const cell = document.createElement("th");
      cell.textContent = column.name;
      cell.addEventListener("click", () => this.sort(column));
      line.append(cell);
    });
    this.head.append(line);
    box.addEventListener("scroll", () => this.draw());
    new ResizeObserver(() => this.draw()).observe(box);
  }

  show(rows) {
    this.rows = rows.slice();
    this.order();
    this.draw();
  }

  sort(column) {
    this.down = this.by === column && !this.down;
    this.by = column;
    this.order();
    this.draw();
  }

  order() {
    const { by, down } = this;
    [...this.head.rows[0].cells].forEach((cell, k) => { cell.dataset.sort = this.columns[k] === by ? (down ? "▾" : "▴") : ""; });
    if (!by) return;
    const turn = down ? -1 : 1, none = (i) => Number.isNaN(by.values[i]);
    const key = (i) => (by.texts ? by.texts[by.values[i]] : by.values[i]);
    this.rows.sort((a, b) => { // what is missing stays last
      if (none(a) || none(b)) return none(a) - none(b) || a - b;
      return (key(a) < key(b) ? -turn : key(a) > key(b) ? turn : a - b);
    });
  }

  draw() {
    const first = Math.max(0, Math.floor(this.box.scrollTop / HEIGHT) - 5);
    const last = Math.min(this.rows.length, first + Math.ceil(this.box.clientHeight / HEIGHT) + 12);
    const lines = [this.filler(first)];
    for (const i of this.rows.slice(first, last)) {
      const line = document.createElement("tr");
      for (const column of this.columns) line.insertCell().textContent = column.text(column.values[i]);
      line.classList.toggle("on", i === this.open);
      line.addEventListener("click", () => { this.open = i; this.onRow(i); this.draw(); });
      lines.push(line);
    }
    lines.push(this.filler(this.rows.length - last));
    this.body.replaceChildren(...lines);
  }

  filler(rows) {
    const line = document.createElement("tr");
    line.style.height = `${rows * HEIGHT}px`;
    return line;
  }
}
