// The player itself: what it holds, how it draws, and how time goes on.

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
