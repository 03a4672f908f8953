// Unpacks the numbers and puts up one card for each plot.

function unpacked(text) {
  const bytes = Uint8Array.from(atob(text.slice(1)), (letter) => letter.charCodeAt(0));
  return text[0] === "d" ? new Float64Array(bytes.buffer) : new Float32Array(bytes.buffer);
}

// Every {"$": n} in the document stands for array n.
function filled(value, arrays) {
  if (Array.isArray(value)) return value.map((part) => filled(part, arrays));
  if (value === null || typeof value !== "object") return value;
  if ("$" in value) return arrays[value.$];
  return Object.fromEntries(Object.entries(value).map(([name, part]) => [name, filled(part, arrays)]));
}

const packed = JSON.parse($("data").textContent);
const shown = filled(packed.plots, packed.arrays.map(unpacked));

$("name").textContent = shown.name;
$("facts").textContent = shown.facts;
time.full = shown.span;
time.view = [...shown.span];
for (const figure of shown.figures) {
  const chart = figure.floor ? new FloorChart(figure) : new TimeChart(figure);
  time.charts.push(chart);
  $("cards").append(chart.element);
}
const missing = Object.entries(shown.missing);
$("missing").hidden = missing.length === 0;
$("missing").append("Not here: ", missing.map(([kind, why]) => `${kind} (${why})`).join(", "));

function setTheme(theme) {
  document.documentElement.dataset.theme = theme;
  $("theme").textContent = theme === "dark" ? "Light" : "Dark";
  readColours();
  time.redraw();
}
const dark = matchMedia("(prefers-color-scheme: dark)");
setTheme(dark.matches ? "dark" : "light");
dark.addEventListener("change", () => setTheme(dark.matches ? "dark" : "light"));
$("theme").addEventListener("click", () => setTheme(document.documentElement.dataset.theme === "dark" ? "light" : "dark"));
$("all").addEventListener("click", () => {
  for (const chart of time.charts) chart.fitted = true;
  time.show(...time.full);
});
