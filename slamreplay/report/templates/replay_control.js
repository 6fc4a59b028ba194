// The player itself: time, keys, buttons, links; nothing is unpacked before somebody looks.

const section = document.getElementById("replay");
const find = (id) => document.getElementById(`replay-${id}`);
const calm = matchMedia("(prefers-reduced-motion: reduce)");
const CALM_STEP_S = 0.5; // without motion, playing shows stills so long apart
const SAY_MS = 250; // the moment in words changes no faster while it plays

const player = {
  scene: null, t: 0, playing: false, speed: 1, following: false, measuring: false, measured: [],
  pointer: null, hovered: null, inks: null, ground: null, course: null, told: 0,
  view: { x: 0, y: 0, scale: 1, width: 1, height: 1, fitted: true },
  layers: new Set(), map: find("map"), lanes: find("lanes"), tip: find("tip"),
  tell: (text) => { find("say").textContent = text; },
};
let starting = null;
let frame = 0;
let lastTick = 0;
let owed = 0;
let linkTimer = 0;

// ---- drawing: at most once a frame, and only when something changed

function redraw(mapOnly = false) {
  if (!player.scene) return;
  player.stale = player.stale || !mapOnly;
  if (!frame) frame = requestAnimationFrame(draw);
}

function draw(now) {
  frame = 0;
  if (player.playing) advance(now);
  paint(player.stale || player.playing);
  player.stale = false;
  if (player.playing && !frame) frame = requestAnimationFrame(draw);
}

function paint(withLanes) {
  drawMap(player);
  player.map.dataset.pxPerM = player.view.scale.toFixed(4);
  if (withLanes) drawLanes(player);
  find("where").textContent = player.pointer && player.scene.head.window ? placeText() : "";
}

function placeText() {
  const { x, y } = toMap(player.view, ...player.pointer);
  return `x ${x.toFixed(2)} m, y ${y.toFixed(2)} m in ${player.scene.head.frame}`;
}

function advance(now) {
  const passed = lastTick ? Math.min((now - lastTick) / 1000, 0.25) : 0;
  lastTick = now;
  owed += passed;
  if (calm.matches && owed < CALM_STEP_S) return;
  const t = player.t + owed * player.speed;
  owed = 0;
  if (t >= player.scene.head.end_s) { moveTo(player.scene.head.end_s); play(false); return; }
  moveTo(t);
}

// ---- time

function moveTo(t) {
  const end = player.scene.head.end_s;
  player.t = Math.min(Math.max(t, 0), end);
  find("time").value = player.t;
  find("clock").textContent = `${player.t.toFixed(1)} / ${end.toFixed(1)} s`;
  section.dataset.t = player.t.toFixed(3);
  const now = performance.now();
  if (player.playing && now - player.told < SAY_MS) return;
  player.told = now;
  const words = momentText(player.scene, player.t);
  player.tell(words);
  find("time").setAttribute("aria-valuetext", words);
}

function seek(t) {
  moveTo(t);
  redraw();
  keepLink();
}

function play(on) {
  if (on && player.t >= player.scene.head.end_s - 1e-6) moveTo(0);
  player.playing = on;
  lastTick = owed = 0;
  find("play").setAttribute("aria-label", on ? "Pause" : "Play");
  section.toggleAttribute("data-playing", on);
  // While it plays the words change all the time: a screen reader is told when it stops.
  find("say").setAttribute("aria-live", on ? "off" : "polite");
  if (!on) seek(player.t);
  redraw();
}

function step(times, way) {
  const later = way > 0;
  const beyond = times.filter((t) => (later ? t > player.t + 1e-3 : t < player.t - 1e-3));
  if (!beyond.length) return;
  if (player.playing) play(false);
  seek(later ? Math.min(...beyond) : Math.max(...beyond));
}

const stepMark = (way) => step(player.scene.head.marks.map((mark) => mark.t), way);
const stepScan = (way) => step(player.scene.scans.length ? Array.from(player.scene.scans[0].t) : [], way);

// ---- links: #t=42.3&x=1.2&y=3.4&z=12, z being metres across the map

function hashOf() {
  const { view } = player;
  const place = view.fitted ? "" : `&x=${view.x.toFixed(2)}&y=${view.y.toFixed(2)}&z=${(view.width / view.scale).toFixed(2)}`;
  return `#t=${Number(player.t.toFixed(2))}${place}`;
}

function keepLink() {
  clearTimeout(linkTimer);
  if (player.playing) return;
  linkTimer = setTimeout(() => {
    try { history.replaceState(null, "", hashOf()); } catch { /* a page without an address */ }
  }, 300);
}

function asked(hash) {
  const wanted = new URLSearchParams(hash.replace(/^#/, ""));
  const number = (name) => (wanted.has(name) && wanted.get(name) !== "" ? Number(wanted.get(name)) : NaN);
  const [t, x, y, z] = ["t", "x", "y", "z"].map(number);
  return Number.isFinite(t) ? { t, x, y, z } : null;
}

async function follow(hash) {
  const wanted = asked(hash);
  if (!wanted || !(await start())) return;
  if (player.playing) play(false);
  if (Number.isFinite(wanted.x + wanted.y) && wanted.z > 0) {
    sharpSize();
    Object.assign(player.view, { x: wanted.x, y: wanted.y, scale: player.view.width / wanted.z, fitted: false });
  }
  clearTimeout(linkTimer);
  moveTo(wanted.t);
  redraw();
  section.scrollIntoView({ block: "start", behavior: "auto" });
  player.map.focus({ preventScroll: true });
}

async function copyLink() {
  const link = location.href.replace(/#.*$/, "") + hashOf();
  let copied = true;
  try { await navigator.clipboard.writeText(link); } catch { copied = false; }
  player.tell(copied ? `Copied: ${hashOf()}` : `Link to this moment: ${link}`);
}

// ---- switches

function measure(on) {
  player.measuring = on;
  player.measured = [];
  find("measure").setAttribute("aria-pressed", String(on));
  section.toggleAttribute("data-measuring", on);
  if (on) player.tell("Measure: click two points, or press enter for the middle of the map.");
  redraw(true);
}

function followRobot(on) {
  const { view, scene } = player;
  player.following = on;
  if (on) { view.fitted = false; view.scale = Math.max(view.scale, ROBOT_SCALE); }
  if (!on && !scene.head.window) return;
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

// ---- keys: only while something of the replay has the focus

const KEYS = {
  " ": () => play(!player.playing), k: () => play(!player.playing),
  ArrowLeft: (event) => (event.shiftKey ? stepScan(-1) : seek(player.t - 1)),
  ArrowRight: (event) => (event.shiftKey ? stepScan(1) : seek(player.t + 1)),
  Home: () => seek(0), End: () => seek(player.scene.head.end_s),
  n: () => stepMark(1), p: () => stepMark(-1),
  "+": () => zoomBy(1.4), "=": () => zoomBy(1.4), "-": () => zoomBy(1 / 1.4), 0: fitAll,
  w: () => panBy(0, 60), s: () => panBy(0, -60), a: () => panBy(60, 0), d: () => panBy(-60, 0),
  f: () => followRobot(!player.following), m: () => measure(!player.measuring), l: copyLink,
  "?": () => { const help = find("help"); help.open = !help.open; },
};
const NUMBERED = {
  1: ["belief", "odometry"], 2: ["hindsight"], 3: ["scan-belief"], 4: ["scan-hindsight"],
  5: ["uncertainty"], 6: ["particles"], 7: ["plan"], 8: ["changes"], 9: ["map"],
};

function onKey(event) {
  if (!player.scene || event.ctrlKey || event.altKey || event.metaKey) return;
  const own = event.target.tagName; // what a control does with a key of its own stays so
  if (own === "SELECT" || own === "SUMMARY" && event.key !== "?") return;
  if ((own === "BUTTON" || own === "INPUT" && event.target.type === "checkbox") && event.key === " ") return;
  if (event.key === "Enter" && player.measuring && event.target === player.map) {
    addMeasured(player, { x: player.view.x, y: player.view.y });
    redraw(true);
  } else if (event.key === "Escape" && player.measuring) measure(false);
  else if (NUMBERED[event.key]) NUMBERED[event.key].forEach(toggleLayer);
  else {
    const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    if (!Object.hasOwn(KEYS, key)) return;
    KEYS[key](event);
  }
  event.preventDefault();
}

// ---- start

function start() {
  starting = starting || begin().catch((trouble) => { fail(trouble); return false; });
  return starting;
}

async function begin() {
  if (typeof DecompressionStream === "undefined") {
    throw new Error("this browser cannot unpack it (it lacks DecompressionStream)");
  }
  section.dataset.state = "loading";
  player.scene = sceneOf(await unpack(find("data").textContent));
  const { head } = player.scene;
  find("time").max = head.end_s;
  find("time").disabled = false;
  readInks();
  offerLayers();
  listen();
  sharpSize();
  moveTo(head.open_s);
  paint(true);
  section.dataset.state = "ready";
  return true;
}

function fail(trouble) {
  section.dataset.state = "failed";
  const told = find("trouble");
  told.hidden = false;
  told.textContent = `The replay cannot be shown: ${trouble.message}. The figures of this page show the same log, standing still.`;
}

function readInks() {
  player.inks = inksOf(section);
  redraw();
}

function sharpSize() {
  player.lanes.style.height = `${lanesHeight(section, player.lanes.clientWidth)}px`;
  player.view.width = player.map.clientWidth;
  player.view.height = player.map.clientHeight;
}

function listen() {
  listenToMap(player, redraw);
  listenToLanes(player, seek, redraw);
  player.map.addEventListener("pointerup", keepLink);
  section.addEventListener("keydown", onKey);
  const click = (id, act) => find(id).addEventListener("click", act);
  click("play", () => play(!player.playing));
  click("back-mark", () => stepMark(-1));
  click("next-mark", () => stepMark(1));
  click("back-scan", () => stepScan(-1));
  click("next-scan", () => stepScan(1));
  click("in", () => zoomBy(1.4));
  click("out", () => zoomBy(1 / 1.4));
  click("fit", fitAll);
  click("follow", () => followRobot(!player.following));
  click("measure", () => measure(!player.measuring));
  click("link", copyLink);
  find("time").addEventListener("input", (event) => seek(Number(event.target.value)));
  find("speed").addEventListener("change", (event) => { player.speed = Number(event.target.value); });
  section.addEventListener("change", (event) => { if (event.target.name === "layer") readLayers(); });
  new ResizeObserver(() => {
    if (section.hasAttribute("data-paper")) return; // what is drawn is stretched onto the paper
    sharpSize();
    redraw();
  }).observe(section);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", readInks);
  new MutationObserver(readInks).observe(document.documentElement, { attributes: true });
  addEventListener("beforeprint", () => forPaper(true));
  addEventListener("afterprint", () => forPaper(false));
}

// On paper: the still of the moment in ink on white, with its words below it.
function forPaper(on) {
  if (player.playing) play(false);
  section.toggleAttribute("data-paper", on);
  player.inks = inksOf(section);
  player.course = null;
  paint(true);
}

player.lanes.style.height = `${lanesHeight(section, player.lanes.clientWidth)}px`;
if (section.clientWidth < NARROW) find("shown").open = false; // a phone has no room for all of it
addEventListener("hashchange", () => follow(location.hash));
// The same link twice changes no address, and still asks for its moment.
document.addEventListener("click", (event) => {
  const link = event.target.closest && event.target.closest('a[href^="#t="]');
  if (link && link.hash === location.hash) follow(link.hash);
});
section.addEventListener("focusin", start, { once: true });
if (asked(location.hash)) follow(location.hash);
else {
  const near = new IntersectionObserver((seen) => {
    if (!seen.some((one) => one.isIntersecting)) return;
    near.disconnect();
    (window.requestIdleCallback || setTimeout)(start);
  }, { rootMargin: "150px" });
  near.observe(section);
}
