// Sliders of objectives, with the better end on the right. Dragging requests predictions, one at a time and only the
// newest; release requests the certified point.

const digits = (value) => Number(value.toPrecision(4)).toString();
const withUnit = (value, unit) => `${digits(value)} ${unit}`.trim();

function makeRow(objective, axis, several) {
  const row = document.createElement("div");
  row.className = "paretoik-row";
  const name = document.createElement("label");
  const slider = document.createElement("input");
  const value = document.createElement("output");
  const hold = document.createElement("input");
  const holdLabel = document.createElement("label");
  slider.id = `paretoik-${axis}-${Math.random().toString(36).slice(2)}`;
  name.htmlFor = slider.id;
  name.textContent = objective.name;
  Object.assign(slider, { type: "range", min: 0, max: 1, step: 0.001 });
  hold.type = "checkbox";
  holdLabel.append(hold, " may not get worse");
  holdLabel.hidden = !several;
  const ends = [document.createElement("span"), document.createElement("span")];
  ends[0].title = "worst on the front";
  ends[1].title = "best on the front";
  row.append(name, ends[0], slider, ends[1], value, holdLabel);
  return { row, slider, value, hold, ends };
}

function render({ model, el }) {
  el.classList.add("paretoik-sliders");
  const rows = model.get("state").objectives.map((each, axis, all) => makeRow(each, axis, all.length > 2));
  const words = document.createElement("p");
  words.setAttribute("role", "status");
  el.append(...rows.map((each) => each.row), words);
  let sent = 0;
  let asked = null; // the newest wish, while an earlier one is not answered yet
  let dragged = null; // the axis under the pointer
  let released = null; // the axis whose move is in progress; meanwhile nothing can be dragged

  const share = (objective, value) =>
    objective.best === objective.worst ? 1 : (value - objective.worst) / (objective.best - objective.worst);

  function show() {
    const state = model.get("state");
    el.dataset.kind = state.kind;
    words.textContent = released === null ? state.words : "moving to a certified point …";
    state.objectives.forEach((objective, axis) => {
      const { slider, value, ends } = rows[axis];
      const at = objective.predicted ?? objective.value;
      if (axis !== dragged) slider.value = share(objective, at);
      ends[0].textContent = withUnit(objective.worst, objective.unit);
      ends[1].textContent = withUnit(objective.best, objective.unit);
      const now = withUnit(objective.value, objective.unit);
      value.textContent = objective.predicted === null ? now : `${now} → ${withUnit(objective.predicted, objective.unit)}`;
      value.classList.toggle("predicted", objective.predicted !== null);
      slider.setAttribute("aria-valuetext", value.textContent);
      slider.disabled = !state.movable || released !== null;
    });
  }

  function send(wish) {
    if (model.get("state").answered < sent) {
      asked = wish;
      return;
    }
    asked = null;
    sent += 1;
    model.send({ ...wish, number: sent });
  }

  function wish(kind, axis) {
    const objective = model.get("state").objectives[axis];
    const here = share(objective, objective.value);
    const to = Math.max(Number(rows[axis].slider.value), here);
    rows[axis].slider.value = to;
    const hold = rows.flatMap((each, other) => (each.hold.checked && other !== axis ? [other] : []));
    const worse = to - here < 1e-6;
    send({ kind: worse ? "cancel" : kind, axis, hold, to: objective.worst + to * (objective.best - objective.worst) });
  }

  rows.forEach(({ slider }, axis) => {
    slider.addEventListener("input", () => {
      dragged = axis;
      wish("drag", axis);
    });
    slider.addEventListener("change", () => {
      dragged = null;
      released = axis;
      wish("release", axis);
      show();
    });
  });
  const update = () => {
    const answered = model.get("state").answered >= sent;
    const last = answered && asked === null ? released : null;
    if (last !== null) released = null;
    show();
    if (last !== null) rows[last].slider.focus(); // a slider loses the focus while it cannot be dragged
    if (answered && asked !== null) send(asked);
  };
  model.on("change:state", update);
  sent = model.get("state").answered;
  show();
  return () => model.off("change:state", update);
}

export default { render };
