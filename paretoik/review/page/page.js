"use strict";
// Shared by all parts of the page: the data, the selected and shown points, and the format of numbers and words.
const data = JSON.parse(document.getElementById("data").textContent);
const byId = (name) => document.getElementById(name);
const rowOf = new Map(data.ids.map((id, row) => [id, row]));
const state = { row: rowOf.get(data.start), shown: data.ids.map(() => true), listeners: [] };
const colour = (place) => data.colours.accents[place % data.colours.accents.length];
const JOINTS = ["#0b7285", "#d9480f", "#5f3dc4", "#2b8a3e", "#c2255c", "#e67700", "#1864ab", "#495057"];

/** Return a number with four digits, without trailing zeros. */
function number(value) {
  if (value === null || !Number.isFinite(value)) return "–";
  const size = Math.abs(value);
  const far = size !== 0 && (size < 1e-3 || size >= 1e5);
  return (far ? value.toExponential(2) : String(Number(value.toPrecision(4)))).replaceAll("-", "−");
}

/** Escape a name, because Plotly reads tags in its labels. */
const plain = (text) => text.replace(/&/g, "&amp;").replace(/</g, "&lt;").replace(/>/g, "&gt;");

function make(tag, text, attributes = {}) {
  const element = document.createElement(tag);
  if (text !== undefined) element.textContent = text;
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  return element;
}

/** Return a row of cells; the first one is its heading. */
function tableRow(cells, heading = false) {
  const row = make("tr");
  cells.forEach((cell, place) => row.append(make(heading || place === 0 ? "th" : "td", cell)));
  return row;
}

function withUnit(value, unit) {
  return unit ? `${number(value)} ${unit}` : number(value);
}

/** Tell every part that another point is selected. */
function select(row) {
  if (row === undefined) return;
  state.row = row;
  state.listeners.forEach((listener) => listener(row));
}

async function copy(text, button) {
  try {
    await navigator.clipboard.writeText(text);
  } catch {
    const area = make("textarea", text); // if the page may not use the clipboard
    document.body.append(area);
    area.select();
    document.execCommand("copy");
    area.remove();
  }
  button.classList.add("copied");
  setTimeout(() => button.classList.remove("copied"), 900);
}

const CONFIG = {
  displaylogo: false,
  responsive: true,
  modeBarButtons: [["zoom2d", "pan2d", "resetScale2d", "toImage"]],
};

/** Return a chart's layout; its size follows the page, or the paper's width when printed. */
function layout(height, more) {
  return {
    height,
    autosize: true,
    hovermode: "closest",
    showlegend: true,
    margin: { l: 70, r: 20, t: 62, b: 50 },
    font: { family: "system-ui, Arial, sans-serif", size: 12, color: data.colours.ink },
    legend: { orientation: "h", x: 0, yref: "container", y: 1 - 30 / height, yanchor: "top", font: { size: 12 } },
    hoverlabel: {
      align: "left",
      bgcolor: "white",
      bordercolor: data.colours.quiet,
      font: { color: data.colours.ink },
    },
    ...more,
  };
}

const axis = (title, more = {}) => ({
  title: { text: plain(title), standoff: 8 },
  gridcolor: data.colours.grid,
  linecolor: data.colours.quiet,
  ticks: "outside",
  tickcolor: data.colours.quiet,
  zeroline: false,
  automargin: true,
  nticks: 6,
  exponentformat: "power",
  minexponent: 4,
  ...more,
});

/** Return the channels of a block: planes of bytes, 16-bit changes from sample to sample. */
async function unpack(block) {
  const { low, step, samples } = data.motions;
  const bytes = await inflate(block);
  const count = low.length * samples;
  return low.map((least, channel) => {
    const values = new Float64Array(samples);
    let whole = 0;
    for (let i = 0; i < samples; i++) {
      const place = channel * samples + i;
      whole = (whole + bytes[place] + 256 * bytes[count + place]) & 65535;
      values[i] = least + whole * step[channel];
    }
    return values;
  });
}

async function inflate(base64) {
  const packed = Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}
