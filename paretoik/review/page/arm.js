// The arm: a picture in the plane or in space that plays its motion and can be turned.
const scene = data.motions && data.motions.arm;
const view = { yaw: -0.9, pitch: 0.45, channels: null, sample: 0, playing: false, begun: 0 };
const PICTURE = { width: 560, height: 430, margin: 46 };
const svgTag = (tag, attributes) => {
  const element = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  return element;
};

/** Return a point of the picture before scaling: unchanged in the plane, a projection in space. */
function project(point) {
  if (scene.planar) return [point[0], point[1]];
  const [c, s] = [Math.cos(view.yaw), Math.sin(view.yaw)],
    [cp, sp] = [Math.cos(view.pitch), Math.sin(view.pitch)];
  const depth = -s * point[0] + c * point[1];
  return [c * point[0] + s * point[1], cp * point[2] + sp * depth];
}

/** Return the scale and middle that show everything; a turning view shows the enclosing ball. */
function frame() {
  const middle = scene.low.map((low, k) => 0.5 * (low + scene.high[k])),
    size = scene.low.map((low, k) => scene.high[k] - low);
  const room = [PICTURE.width - 2 * PICTURE.margin, PICTURE.height - 2 * PICTURE.margin];
  const scale = scene.planar
    ? Math.min(room[0] / (size[0] || 1), room[1] / (size[1] || 1))
    : (1.15 * Math.min(...room)) / (Math.hypot(...size) || 1);
  const centre = project(middle);
  return (point) => {
    const [x, y] = project(point);
    return [PICTURE.width / 2 + scale * (x - centre[0]), PICTURE.height / 2 - scale * (y - centre[1])];
  };
}

const pathOf = (points, place) =>
  points
    .map((point) =>
      place(point)
        .map((value) => value.toFixed(1))
        .join(","),
    )
    .join(" ");

/** Return ticks at round numbers, about five per axis. */
function ticks(low, high) {
  const rough = (high - low) / 5 || 1,
    power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].find((each) => each * power >= rough) * power,
    values = [];
  for (let count = Math.ceil(low / step - 1e-9); count * step <= high + 1e-9 * step; count++)
    values.push(count * step);
  return values;
}

function drawAxes(svg, place) {
  const line = (from, to, style) =>
    svg.append(svgTag("polyline", { points: pathOf([from, to], place), fill: "none", ...style }));
  const text = (words, at, more) => {
    const label = svgTag("text", { x: at[0], y: at[1], "text-anchor": "middle", ...more });
    label.textContent = words;
    svg.append(label);
  };
  const grid = { stroke: data.colours.grid, "stroke-width": 1 };
  const { low, high } = scene;
  if (scene.planar) {
    for (const x of ticks(low[0], high[0])) {
      line([x, low[1]], [x, high[1]], grid);
      text(number(x), [place([x, 0])[0], place(low)[1] + 16]);
    }
    for (const y of ticks(low[1], high[1])) {
      line([low[0], y], [high[0], y], grid);
      text(number(y), [place(low)[0] - 6, place([0, y])[1] + 4], { "text-anchor": "end" });
    }
    text("x [m]", [place(high)[0], place(low)[1] + 32], { "text-anchor": "end" });
    text("y [m]", [place(low)[0], place(high)[1] - 10]);
    return;
  }
  for (const x of ticks(low[0], high[0])) line([x, low[1], low[2]], [x, high[1], low[2]], grid);
  for (const y of ticks(low[1], high[1])) line([low[0], y, low[2]], [high[0], y, low[2]], grid);
  ["x", "y", "z"].forEach((name, k) => {
    const end = [...low];
    end[k] = high[k];
    line(low, end, { stroke: data.colours.quiet, "stroke-width": 1.2 });
    const beside = [...end];
    beside[k] += 0.06 * Math.hypot(...low.map((value, i) => high[i] - value));
    text(`${name} [m]`, place(beside));
    const marks = ticks(low[k], high[k]);
    marks.forEach((value, i) => {
      if ((i % 2 && marks.length > 4) || value - low[k] < 0.12 * (high[k] - low[k])) return;
      const at = [...low];
      at[k] = value;
      const [u, v] = place(at);
      text(number(value), k === 2 ? [u - 6, v + 4] : [u, v + 15], {
        "text-anchor": k === 2 ? "end" : "middle",
        style: `fill:${data.colours.quiet}`,
      });
    });
  });
}

/** Return the nodes of the arm at a sample, base first. */
function nodesAt(sample) {
  const size = scene.planar ? 2 : 3,
    first = view.channels.length - size * scene.nodes;
  return Array.from({ length: scene.nodes }, (_, node) =>
    Array.from({ length: size }, (_, k) => view.channels[first + size * node + k][sample]),
  );
}

function drawArm() {
  const svg = svgTag("svg", {
    viewBox: `0 0 ${PICTURE.width} ${PICTURE.height}`,
    role: "img",
    "aria-label": "the arm along its motion",
  });
  const place = frame(),
    samples = data.motions.samples;
  drawAxes(svg, place);
  const draw = (points, style) =>
    svg.append(
      svgTag("polyline", {
        points: pathOf(points, place),
        fill: "none",
        "stroke-linecap": "round",
        "stroke-linejoin": "round",
        ...style,
      }),
    );
  scene.obstacles.forEach((line) =>
    draw(line, scene.planar ? { fill: "#c9ced4", stroke: "#868e96" } : { stroke: "#868e96", "stroke-width": 1 }),
  );
  const ghosts = data.motions.standing ? [] : [0, 1, 2, 3, 4, 5, 6].map((k) => Math.round((k * (samples - 1)) / 6));
  ghosts.forEach((sample) =>
    draw(nodesAt(sample), { stroke: data.colours.quiet, "stroke-opacity": 0.3, "stroke-width": 1.5 }),
  );
  scene.paths.forEach((path) => draw(path, { stroke: "#212529", "stroke-dasharray": "3 4", "stroke-width": 1.2 }));
  if (!data.motions.standing)
    draw(
      Array.from({ length: samples }, (_, sample) => nodesAt(sample).at(-1)),
      { stroke: colour(0), "stroke-width": 2 },
    );
  view.place = place;
  // one line for links of one radius, otherwise a line per link
  view.links = [scene.radius].flat().map((radius) =>
    svgTag("polyline", {
      fill: "none",
      stroke: data.colours.ink,
      "stroke-width": Math.max(2 * radius * scaleOf(place), 4),
      "stroke-opacity": radius > 0 ? 0.55 : 1,
      "stroke-linecap": "round",
      "stroke-linejoin": "round",
    }),
  );
  view.joints = Array.from({ length: scene.nodes }, (_, node) =>
    svgTag("circle", {
      r: node === scene.nodes - 1 ? 5 : 4,
      fill: node === scene.nodes - 1 ? colour(0) : "white",
      stroke: data.colours.ink,
      "stroke-width": 1.5,
    }),
  );
  svg.append(...view.links, ...view.joints, ...drawArrows(place));
  if (!scene.planar) svg.addEventListener("pointerdown", turn);
  byId("arm").replaceChildren(svg);
  moveArm(view.sample);
}

function scaleOf(place) {
  const one = scene.planar ? [1, 0] : [Math.cos(view.yaw), Math.sin(view.yaw), 0],
    none = one.map(() => 0);
  return Math.hypot(...place(one).map((value, k) => value - place(none)[k]));
}

/** Draw the speed or force along each direction as an arrow from the tool; equal units share a scale. */
function drawArrows(place) {
  const tool = nodesAt(0).at(-1),
    largest = {},
    extent = Math.max(...scene.high.map((high, k) => high - scene.low[k]));
  scene.arrows.forEach(({ axis: k }) => {
    const { unit } = data.objectives[k];
    largest[unit] = Math.max(largest[unit] || 0, Math.abs(data.ranges[k][1]));
  });
  return scene.arrows.flatMap(({ axis: k, along }) => {
    const length = (0.3 * extent * data.values[state.row][k]) / (largest[data.objectives[k].unit] || 1);
    const end = tool.map((value, i) => value + length * along[i]),
      [u, v] = place(end);
    const label = svgTag("text", { x: u, y: v - 8, "text-anchor": u > 0.7 * PICTURE.width ? "end" : "start" });
    label.textContent = `${data.objectives[k].name} ${withUnit(data.values[state.row][k], data.objectives[k].unit)}`;
    return [
      svgTag("polyline", { points: pathOf([tool, end], place), stroke: colour(1), "stroke-width": 2.5 }),
      svgTag("circle", { cx: u, cy: v, r: 3.5, fill: colour(1) }),
      label,
    ];
  });
}

function moveArm(sample) {
  view.sample = sample;
  const spots = nodesAt(sample).map(view.place);
  view.links.forEach((line, link) => {
    const ends = view.links.length > 1 ? spots.slice(link, link + 2) : spots;
    line.setAttribute("points", ends.map((spot) => spot.map((value) => value.toFixed(1)).join(",")).join(" "));
  });
  view.joints.forEach((joint, node) => {
    joint.setAttribute("cx", spots[node][0]);
    joint.setAttribute("cy", spots[node][1]);
  });
  byId("time").value = sample;
  byId("time-text").textContent = `${view.channels[0][sample].toFixed(2)} s`;
}

function turn(event) {
  const from = { x: event.clientX, y: event.clientY, yaw: view.yaw, pitch: view.pitch };
  const move = (moved) => {
    view.yaw = from.yaw - (moved.clientX - from.x) / 150;
    view.pitch = Math.min(Math.max(from.pitch + (moved.clientY - from.y) / 150, -1.5), 1.5);
    drawArm();
  };
  const stop = () => {
    removeEventListener("pointermove", move);
    removeEventListener("pointerup", stop);
  };
  addEventListener("pointermove", move);
  addEventListener("pointerup", stop);
  event.preventDefault();
}

function play(now) {
  if (!view.playing) return;
  const time = view.channels[0],
    first = time[0],
    last = time[time.length - 1];
  if (!view.begun) view.begun = now - 1000 * (time[view.sample] - first);
  const seconds = first + (now - view.begun) / 1000;
  const next = time.findIndex((each) => each >= seconds);
  moveArm(next < 0 ? time.length - 1 : next);
  moveCursor(time[view.sample]);
  if (seconds > last) setPlaying(false);
  else requestAnimationFrame(play);
}

function setPlaying(playing) {
  if (playing && view.sample === data.motions.samples - 1) view.sample = 0;
  view.playing = playing;
  view.begun = 0;
  byId("play").textContent = playing ? "stop" : "play";
  if (playing) requestAnimationFrame(play);
}

function makePlayer() {
  byId("time").max = data.motions.samples - 1;
  byId("time").addEventListener("input", (event) => {
    setPlaying(false);
    moveArm(+event.target.value);
    moveCursor(view.channels[0][view.sample]);
  });
  byId("play").addEventListener("click", () => setPlaying(!view.playing));
}

/** Show the motion of a point, or why there is none. */
async function showMotion(row) {
  const block = data.motions && data.blocks[data.ids[row]];
  const without = !data.motions
    ? "This front has no motions."
    : block
      ? ""
      : "The motion of this point is left out to limit the size of the page; the run has it.";
  byId("no-motion").textContent = without;
  byId("arm-box").hidden = !block || !scene;
  byId("curves").hidden = !block;
  if (!block) {
    setPlaying(false);
    return;
  }
  const channels = await unpack(block);
  if (row !== state.row) return; // another point was selected in the meantime
  view.channels = channels;
  if (scene) drawArm();
  byId("player").hidden = data.motions.standing;
  if (data.motions.standing) writePosture(channels);
  else {
    drawCurves(channels);
    moveCursor(channels[0][view.sample]);
  }
}
