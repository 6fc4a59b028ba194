// What can be switched: the part of the map that is seen, measuring, and layers.

function measure(on) {
  player.measuring = on;
  player.measured = [];
  find("measure").setAttribute("aria-pressed", String(on));
  section.toggleAttribute("data-measuring", on);
  if (on) player.tell("Measure: click two points, or press enter for the middle of the map.");
  redraw(true);
}

function followRobot(on) {
  const { view } = player;
  player.following = on;
  if (on) { view.fitted = false; view.scale = Math.max(view.scale, ROBOT_SCALE); }
  find("follow").setAttribute("aria-pressed", String(on));
  redraw(true);
}

function fitAll() {
  followRobot(false);
  player.view.fitted = true;
  redraw(true);
  keepLink();
}

function zoomBy(factor) {
  const { view, scene } = player;
  if (scene.head.window) zoom(view, factor, view.width / 2, view.height / 2, scene.head.window);
  redraw(true);
  keepLink();
}

function panBy(x, y) {
  followRobot(false);
  pan(player.view, x, y);
  redraw(true);
  keepLink();
}

function toggleLayer(box) {
  const boxes = section.querySelectorAll(`input[name="layer"][value="${box}"]`);
  for (const one of boxes) if (!one.closest("label").hidden) one.click();
}

function readLayers() {
  const boxes = [...section.querySelectorAll('input[name="layer"]')];
  player.layers = new Set(boxes.filter((box) => box.checked && !box.closest("label").hidden).map((box) => box.value));
  redraw(true);
}

// Only what the log has can be shown or hidden.
function offerLayers() {
  const { scene } = player;
  const { tracks, head } = scene;
  const seen = new Set();
  for (const scans of scene.scans) for (const one of scans.met) seen.add(one);
  const laid = tracks.hindsight || tracks.odometry;
  const met = (kinds) => laid && kinds.some((kind) => seen.has(kind));
  const has = {
    belief: tracks.belief, hindsight: tracks.hindsight, odometry: tracks.odometry,
    "scan-belief": tracks.belief && scene.scans.length,
    "scan-hindsight": laid && scene.scans.length,
    uncertainty: Object.values(tracks).some((track) => track.ellipse),
    particles: scene.particles, plan: scene.plans, map: scene.ground, stops: head.stops.length,
    changes: head.regions.length || (scene.ground && scene.ground.codes.some((code) => code > 3)),
    "met-mapped": met([MAPPED]), "met-appeared": met([APPEARED]), "met-moving": met([MOVING]),
    "met-removed": met([REMOVED, REMOVED_UNSEEN]), "met-other": met([OTHER]),
  };
  for (const label of section.querySelectorAll("[data-layer]")) label.hidden = !has[label.dataset.layer];
  if (tracks.odometry) {
    section.querySelector('[data-layer="scan-hindsight"] span').textContent = "scan, laid where odometry leads";
  }
  readLayers();
}
