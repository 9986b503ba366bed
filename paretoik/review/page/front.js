// The front: all pairs of up to five objectives, parallel coordinates for three or more, filters and the table.
const many = data.objectives.length;
const ZOOM = { uirevision: "front" }; // keeps the zoom when another point is selected

function describe(row) {
  const lines = [`<b>point ${data.ids[row]}</b>` + (mark(row) ? ` (${plain(mark(row))})` : "")];
  data.objectives.forEach((each, k) =>
    lines.push(plain(`${each.name}: ${withUnit(data.values[row][k], each.unit)}`)),
  );
  if (data.status) lines.push(data.status[row]);
  if (data.motions && !data.blocks[data.ids[row]]) lines.push("its motion is not in this page");
  return lines.join("<br>");
}

const mark = (row) => data.marks[data.ids[row]] || "";
const visible = () => data.ids.map((_, row) => row).filter((row) => state.shown[row]);
const column = (rows, k) => rows.map((row) => data.values[row][k]);

/** Return the groups of points with the same look; later groups are drawn above earlier ones. */
function groups() {
  const rows = visible();
  const marked = (word) => rows.filter((row) => mark(row).includes(word));
  return [
    { name: "front", rows, marker: { color: data.colours.quiet, size: 7 } },
    {
      name: "best of an objective",
      rows: marked("best "),
      marker: { color: colour(2), size: 10, symbol: "diamond" },
    },
    { name: "compromise", rows: marked("compromise"), marker: { color: colour(3), size: 11, symbol: "square" } },
    {
      name: "chosen",
      rows: rows.filter((row) => mark(row).startsWith("chosen") && !mark(row).startsWith("chosen before")),
      marker: { color: colour(1), size: 12, symbol: "star" },
    },
    {
      name: "selected",
      rows: rows.filter((row) => row === state.row),
      marker: { color: "rgba(0,0,0,0)", size: 17, line: { color: colour(0), width: 2.5 } },
    },
  ].filter((group) => group.rows.length);
}

function points(x, y, group, more) {
  return {
    type: "scatter",
    mode: "markers",
    name: group.name,
    legendgroup: group.name,
    marker: group.marker,
    x,
    y,
    customdata: group.rows,
    hoverinfo: "text",
    hovertext: group.rows.map(describe),
    ...more,
  };
}

/** Return the cells of pairs: rows by the second objective, columns by the first. */
function pairs() {
  const cells = [];
  for (let j = 1; j < many; j++) for (let i = 0; i < j; i++) cells.push({ i, j, name: `${j * 10 + i}` });
  return cells;
}

function scatter() {
  const size = many - 1,
    gap = many > 2 ? 0.04 : 0;
  const span = (place) => [
    place / size + (place ? gap / 2 : 0),
    (place + 1) / size - (place < size - 1 ? gap / 2 : 0),
  ];
  const axes = {},
    traces = [];
  for (const { i, j, name } of pairs()) {
    const [x, y] = [data.objectives[i].label, data.objectives[j].label];
    axes[`xaxis${name}`] = axis(j === many - 1 ? x : "", {
      domain: span(i),
      anchor: `y${name}`,
      showticklabels: j === many - 1,
      ticklabeloverflow: many > 2 ? "hide past domain" : "allow", // keep off the numbers of a neighbour
      matches: `x${(many - 1) * 10 + i}`,
    });
    axes[`yaxis${name}`] = axis(i === 0 ? y : "", {
      domain: span(size - j),
      anchor: `x${name}`,
      showticklabels: i === 0,
      matches: `y${j * 10}`,
    });
    if (j === many - 1) delete axes[`xaxis${name}`].matches;
    if (i === 0) delete axes[`yaxis${name}`].matches;
    traces.push(...lines(i, j, name));
    groups().forEach((group) =>
      traces.push(
        points(column(group.rows, i), column(group.rows, j), group, {
          xaxis: `x${name}`,
          yaxis: `y${name}`,
          showlegend: i === 0 && j === 1,
        }),
      ),
    );
  }
  Plotly.react("front", traces, layout(many === 2 ? 460 : 150 + 215 * size, { ...axes, ...ZOOM }), CONFIG);
}

/** Join neighbours on one branch of optima, for two objectives. */
function lines(i, j, name) {
  return (data.branches || []).map((ids) => {
    const rows = ids.map((id) => rowOf.get(id)).filter((row) => state.shown[row]);
    return {
      type: "scatter",
      mode: "lines",
      x: column(rows, i),
      y: column(rows, j),
      xaxis: `x${name}`,
      yaxis: `y${name}`,
      line: { color: data.colours.quiet, width: 1 },
      hoverinfo: "skip",
      showlegend: false,
    };
  });
}

function values() {
  const traces = groups().map((group) => points(column(group.rows, 0), group.rows, group));
  const ids = { tickvals: data.ids.map((_, row) => row), ticktext: data.ids.map(String), nticks: 0 };
  const axes = { xaxis: axis(data.objectives[0].label), yaxis: axis("point", data.ids.length < 30 ? ids : {}) };
  Plotly.react("front", traces, layout(Math.min(180 + 14 * data.ids.length, 420), { ...axes, ...ZOOM }), CONFIG);
}

/** Draw one line per point across one axis per objective, best at the bottom; its corners react to hovering. */
function parallel() {
  const places = data.objectives.map((_, k) => k);
  const traces = groups().map((group) => {
    const x = [],
      y = [],
      rows = [];
    for (const row of group.rows) {
      x.push(...places, null);
      y.push(...data.shares[row], null);
      rows.push(...places.map(() => row), row);
    }
    const plainLine = group.name === "front";
    const tint = plainLine ? data.colours.quiet : group.name === "selected" ? colour(0) : group.marker.color;
    return {
      type: "scatter",
      mode: "lines+markers",
      name: group.name,
      x,
      y,
      customdata: rows,
      opacity: plainLine ? 0.4 : 1,
      line: { color: tint, width: plainLine ? 1 : 2.5 },
      marker: { size: plainLine ? 4 : 6, color: tint },
      hoverinfo: "text",
      hovertext: rows.map(describe),
    };
  });
  const ends = data.objectives.flatMap((each, k) => {
    const [best, worst] = each.maximised ? [...data.ranges[k]].reverse() : data.ranges[k];
    const text = { x: k, showarrow: false, font: { size: 11, color: data.colours.quiet } };
    return [
      { ...text, y: 0, yshift: -12, text: number(best) },
      { ...text, y: 1, yshift: 11, text: number(worst) },
    ];
  });
  Plotly.react(
    "parallel",
    traces,
    layout(380, {
      ...ZOOM,
      margin: { l: 70, r: 70, t: 75, b: 70 },
      annotations: ends,
      xaxis: axis("", {
        tickvals: places,
        ticktext: data.objectives.map((each) => wrapped(each)),
        range: [-0.15, many - 0.85],
        ticks: "",
        showline: false,
        ticklabelstandoff: 14,
      }),
      yaxis: axis("best below, worst above", {
        showticklabels: false,
        showgrid: false,
        showline: false,
        ticks: "",
        range: [-0.03, 1.03],
      }),
    }),
    CONFIG,
  );
}

const wrapped = (each) =>
  plain(each.name) + (each.unit ? `<br>[${plain(each.unit)}]` : "") + (each.maximised ? "<br>more is better" : "");

function drawFront() {
  if (!byId("front")) return; // a single point has none
  if (many === 1) values();
  else if (many <= 5) scatter();
  if (many > 2) parallel();
}

function listenToFront() {
  for (const name of ["front", "parallel"]) {
    const figure = byId(name);
    if (figure && figure.on) figure.on("plotly_click", (event) => select(event.points[0].customdata));
  }
}

/** Make two numbers per objective; points outside are not shown. */
function makeFilters() {
  if (!byId("filters")) return;
  const inputs = data.objectives.map((each) => {
    const label = make("label", each.name + (each.unit ? ` [${each.unit}]` : ""));
    const pair = make("div", undefined, { class: "pair" });
    const ends = ["at least", "at most"].map((words) => {
      const input = make("input", undefined, {
        type: "number",
        step: "any",
        placeholder: words,
        "aria-label": `${each.name} ${words}`,
      });
      input.addEventListener("input", () => filter(inputs));
      pair.append(input);
      return input;
    });
    label.append(pair);
    byId("filters").append(label);
    return ends;
  });
  const reset = make("button", "show all", { type: "button", id: "show-all" });
  reset.addEventListener("click", () => {
    inputs.flat().forEach((input) => {
      input.value = "";
    });
    filter(inputs);
  });
  byId("filters").append(reset);
  byId("filters").addEventListener("submit", (event) => event.preventDefault());
}

function filter(inputs) {
  const bounds = inputs.map(([low, high]) => [
    low.value === "" ? -Infinity : +low.value,
    high.value === "" ? Infinity : +high.value,
  ]);
  state.shown = data.values.map((each) => each.every((value, k) => value >= bounds[k][0] && value <= bounds[k][1]));
  drawFront();
  fillTable();
}

function fillTable() {
  let count = 0;
  for (const line of byId("points").tBodies[0].rows) {
    const row = rowOf.get(+line.dataset.id);
    line.hidden = !state.shown[row];
    line.classList.toggle("selected", row === state.row);
    count += state.shown[row];
  }
  byId("count").textContent = `${count} of ${data.ids.length} points shown.`;
}

function listenToTable() {
  byId("points").addEventListener("click", (event) => {
    const button = event.target.closest("button"),
      line = event.target.closest("tr[data-id]");
    if (button) copy(button.dataset.copy, button);
    else if (line) select(rowOf.get(+line.dataset.id));
  });
  byId("copy-shown").addEventListener("click", (event) =>
    copy(
      visible()
        .map((row) => data.ids[row])
        .join(", "),
      event.target,
    ),
  );
  document.querySelectorAll("button.go").forEach((button) =>
    button.addEventListener("click", () => {
      select(rowOf.get(+button.dataset.id));
      byId("point").scrollIntoView({ behavior: "smooth" });
    }),
  );
}
