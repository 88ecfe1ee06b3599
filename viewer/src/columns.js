// Columns of a table: numbers, or texts as places in a list.

export class Column {
  constructor({ name, values, texts, axis }, rows) {
    Object.assign(this, { name, values, texts, axis });
    const seen = new Set();
    for (let i = 0; i < rows && seen.size <= 24; i++) if (!Number.isNaN(values[i])) seen.add(values[i]);
    // Few values become buttons, many a range.
    this.few = seen.size <= 24 ? [...seen].sort((a, b) => a - b) : null;
  }

  text(value) {
    if (Number.isNaN(value)) return "";
    if (this.texts) return this.texts[value];
    return String(Number(value.toPrecision(5)));
  }
}

// The rows (numbers) that every filter lets through.
export function passing(columns, count) {
  const found = [];
  for (let i = 0; i < count; i++) {
    if (columns.every(({ kept, low, high, values }) =>
      (!kept || kept.has(values[i])) && !(values[i] < low) && !(values[i] > high)
      && !((low !== undefined || high !== undefined) && Number.isNaN(values[i])))) found.push(i);
  }
  return found;
}

// Blue to yellow in equal steps of lightness (viridis).
const STOPS = [[68, 1, 84], [59, 82, 139], [33, 145, 140], [94, 201, 98], [253, 231, 37]];
export function shade(share) {
  const at = Math.min(1, Math.max(0, share)) * (STOPS.length - 1), i = Math.min(STOPS.length - 2, Math.floor(at));
  return `rgb(${STOPS[i].map((c, k) => Math.round(c + (at - i) * (STOPS[i + 1][k] - c))).join()})`;
}

export function select(label, options, chosen, onChange) {
  const box = document.createElement("label"), choice = document.createElement("select");
  box.append(`${label} `, choice);
  options.forEach((name, k) => choice.add(new Option(name, k, k === chosen, k === chosen)));
  choice.addEventListener("change", () => onChange(Number(choice.value)));
  return box;
}
