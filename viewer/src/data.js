// Reads the data that Python put into the page.

// Every {"f32": base64} in the JSON becomes a Float32Array.
function unpack(key, value) {
  if (value && typeof value.f32 === "string") {
    const bytes = Uint8Array.from(atob(value.f32), (c) => c.charCodeAt(0));
    return new Float32Array(bytes.buffer);
  }
  return value;
}

export function readData() {
  return JSON.parse(document.getElementById("data").textContent, unpack);
}

// [i, share]: sorted[i] + share * (sorted[i + 1] - sorted[i]) is the value, clamped to the ends.
export function locate(sorted, value) {
  let low = 0, high = sorted.length - 1;
  if (high < 1 || value <= sorted[0]) return [0, 0];
  if (value >= sorted[high]) return [high - 1, 1];
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (sorted[middle] <= value) low = middle; else high = middle;
  }
  return [low, (value - sorted[low]) / (sorted[high] - sorted[low])];
}

// Linear between samples; rows of `width` numbers, of which the one in `column` is taken.
export function between(values, [i, share], width = 1, column = 0) {
  const a = values[i * width + column];
  const b = values[Math.min((i + 1) * width, values.length - width) + column];
  return a + share * (b - a);
}

// Colours that colour-blind readers can tell apart (Okabe and Ito).
export const COLOURS = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#8a7f00"];
