// The start of the page: unpack and run Plotly, draw everything, and listen to events.
async function start() {
  const script = make("script", new TextDecoder().decode(await inflate(byId("bundle").textContent)));
  document.head.append(script);
  if (!window.Plotly) throw new Error("Plotly did not start");
  makeFilters();
  drawFront();
  listenToFront();
  listenToTable();
  fillTable();
  drawSteps();
  if (data.motions) makePlayer();
  state.listeners.push(showPoint, drawFront, fillTable, showMotion);
  byId("point-copy").addEventListener("click", (event) => copy(String(data.ids[state.row]), event.target));
  showPoint(state.row);
  await showMotion(state.row);
}

/** Make figures as wide as the paper for printing. */
function resize(width) {
  for (const figure of document.querySelectorAll(".js-plotly-plot"))
    Plotly.relayout(figure, { width, autosize: !width });
}

addEventListener("beforeprint", () => window.Plotly && resize(680));
addEventListener("afterprint", () => window.Plotly && resize(null));
if (data.ids.length) {
  start()
    .then(() => {
      document.body.dataset.ready = "yes";
    })
    .catch((error) => {
      byId("fault").textContent =
        `The pictures could not be drawn: ${error.message}. ` +
        "The tables do not need them; browsers from 2023 on can draw the pictures.";
      byId("fault").hidden = false;
    });
}
