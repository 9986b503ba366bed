// The selected point: its values, its exchange rates, and the curves of its joints with their limits.
function showPoint(row) {
  byId("point-id").textContent = data.ids[row];
  byId("point-mark").textContent = mark(row);
  const table = byId("point-values");
  const share = (k) => (data.nearest ? [] : [`${Math.round(100 * data.shares[row][k])} %`]); // only for a front
  table.replaceChildren(tableRow(["objective", "value", ...(data.nearest ? [] : ["from the best"])], true));
  data.objectives.forEach((each, k) =>
    table.append(tableRow([each.name, withUnit(data.values[row][k], each.unit), ...share(k)])),
  );
  if (byId("rates")) showRates(row);
}

/** Show what one unit of each objective costs in every other, all else fixed. */
function showRates(row) {
  const table = make("table"),
    intervals = data.rates[row];
  const certified = intervals.some((costs, i) => costs.some((pair, j) => i !== j && pair[0] !== null)); // diagonal: 1
  if (!certified) {
    byId("rates").replaceChildren(make("p", "Not certified at this point.", { class: "hint" }));
    return;
  }
  const gain = (each) => `1 ${each.unit} ${each.maximised ? "more" : "less"} ${each.name}`.replace("  ", " ");
  table.append(
    tableRow(["costs", ...data.objectives.map((each) => `${each.name}${each.unit ? ` [${each.unit}]` : ""}`)], true),
  );
  data.objectives.forEach((each, i) =>
    table.append(tableRow([gain(each), ...intervals[i].map((pair, j) => (i === j ? "" : rate(pair)))])),
  );
  byId("rates").replaceChildren(table);
}

function rate(pair) {
  const [low, high] = pair.map(Math.abs).sort((a, b) => a - b);
  if (pair[0] === null || pair[1] === null) return "–";
  return high - low <= 1e-3 * high ? number(low) : `${number(low)} to ${number(high)}`;
}

/** Return the limits of a joint as lines: the times of their changes, and their values. */
function limitLines(kind, joint, time) {
  const limits = data.motions.limits && data.motions.limits[kind];
  if (!limits) return [];
  const ends = [time[0], time[time.length - 1]];
  const line = (values) => (limits.times ? { x: limits.times, y: values } : { x: ends, y: [values[0], values[0]] });
  return [line(limits.lower[joint]), line(limits.upper[joint])].filter((each) =>
    each.y.some((value) => value !== null),
  );
}

function drawCurves(channels) {
  const { quantities, joints } = data.motions,
    time = channels[0],
    traces = [],
    axes = {},
    notes = [];
  quantities.forEach(({ name, units }, place) => {
    const height = 1 / quantities.length,
      suffix = place ? place + 1 : "",
      top = 1 - place * height;
    const curves = joints.map((_, joint) => channels[1 + place * joints.length + joint]);
    const low = Math.min(...curves.map((curve) => Math.min(...curve)));
    const high = Math.max(...curves.map((curve) => Math.max(...curve)));
    const near = 1.5 * Math.max(high - low, 1e-12),
      beyond = [];
    joints.forEach((joint, k) => {
      const style = {
        type: "scatter",
        mode: "lines",
        legendgroup: joint,
        yaxis: `y${suffix}`,
        line: { color: JOINTS[k % JOINTS.length], width: 1.8, dash: k < JOINTS.length ? "solid" : "dashdot" },
      };
      traces.push({
        ...style,
        x: time,
        y: curves[k],
        name: plain(joint),
        showlegend: place === 0,
        hoverinfo: "text",
        hovertext: Array.from(curves[k], (value, i) =>
          plain(`${joint} ${name} ${withUnit(value, units[k])} at ${number(time[i])} s`),
        ),
      });
      for (const limit of limitLines(name, k, time)) {
        const finite = limit.y.filter((value) => value !== null);
        if (Math.min(...finite) > high + near || Math.max(...finite) < low - near) {
          beyond.push(finite[0]);
          continue;
        }
        traces.push({
          ...style,
          ...limit,
          line: { ...style.line, width: 1.2, dash: "4px,4px" },
          opacity: 0.75,
          showlegend: false,
          hoverinfo: "text",
          hovertext: limit.y.map((value) => plain(`${name} limit of ${joint}: ${withUnit(value, units[k])}`)),
        });
      }
    });
    const unit = [...new Set(units)].join(", ");
    axes[`yaxis${suffix}`] = axis(`${name} [${unit}]`, {
      domain: [top - height + 0.025, top - 0.005],
      nticks: 5,
      title: { text: `${name}<br>[${plain(unit)}]`, standoff: 4, font: { size: 12 } },
    });
    if (beyond.length) notes.push(`${name} ${[...new Set(beyond.map(number))].join(", ")}`);
  });
  const last = quantities.length > 1 ? `y${quantities.length}` : "y";
  Plotly.react(
    "curves",
    traces,
    layout(112 + 165 * quantities.length, {
      ...axes,
      margin: { l: 80, r: 20, t: 62, b: 50 },
      xaxis: axis("time [s]", { anchor: last, nticks: 12 }),
      shapes: [],
    }),
    CONFIG,
  );
  const words = data.motions.limits && Object.keys(data.motions.limits).length ? "Limits are dashed." : "";
  byId("no-motion").textContent = words + (notes.length ? ` Too far away to be drawn: ${notes.join("; ")}.` : "");
}

/** Move the line at the time of the arm's picture. */
function moveCursor(seconds) {
  if (!byId("curves").layout) return;
  const shape = {
    type: "line",
    xref: "x",
    yref: "paper",
    x0: seconds,
    x1: seconds,
    y0: 0,
    y1: 1,
    line: { color: data.colours.quiet, width: 1 },
  };
  Plotly.relayout("curves", { shapes: [shape] });
}

/** Show the numbers of an arm that stands still, instead of curves. */
function writePosture(channels) {
  const { joints, quantities } = data.motions,
    table = make("table");
  const kinds = quantities
    .map((each, place) => ({ ...each, place }))
    .filter((each) => ["position", "torque"].includes(each.name));
  table.append(tableRow(["joint", ...kinds.map((each) => each.name)], true));
  joints.forEach((joint, k) =>
    table.append(
      tableRow([
        joint,
        ...kinds.map(({ units, place }) => withUnit(channels[1 + place * joints.length + k][0], units[k])),
      ]),
    ),
  );
  byId("curves").replaceChildren(table);
}

/** Draw the steps of a closed loop: chosen values between the best and the worst of each step's front. */
function drawSteps() {
  if (!data.steps) return;
  byId("steps-section").hidden = false;
  const { times, chosen, best, worst } = data.steps,
    traces = [],
    axes = {};
  data.objectives.forEach((each, k) => {
    const height = 1 / many,
      suffix = k ? k + 1 : "",
      pick = (rows) => rows.map((row) => row[k]);
    const style = {
      type: "scatter",
      mode: "lines",
      x: times,
      yaxis: `y${suffix}`,
      showlegend: false,
      hoverinfo: "skip",
      line: { width: 0 },
    };
    const log = [chosen, best, worst].every((rows) => pick(rows).every((value) => value > 0));
    traces.push(
      { ...style, y: pick(best) },
      { ...style, y: pick(worst), fill: "tonexty", fillcolor: "rgba(123,135,148,0.3)" },
    );
    traces.push({
      ...style,
      y: pick(chosen),
      line: { color: colour(1), width: 1.6 },
      hoverinfo: "text",
      hovertext: times.map((time, i) =>
        plain(`${each.name} ${withUnit(chosen[i][k], each.unit)} at ${number(time)} s`),
      ),
    });
    axes[`yaxis${suffix}`] = axis("", {
      title: { text: wrapped(each), standoff: 4, font: { size: 12 } },
      domain: [1 - (k + 1) * height + 0.04, 1 - k * height],
      type: log ? "log" : "linear",
      nticks: 5,
    });
  });
  Plotly.react(
    "steps",
    traces,
    layout(80 + 190 * many, {
      ...axes,
      showlegend: false,
      xaxis: axis("time [s]", { anchor: many > 1 ? `y${many}` : "y", nticks: 12 }),
    }),
    CONFIG,
  );
}
