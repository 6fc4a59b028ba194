// Colours from the style sheet, shapes and hatches: nothing is told by its colour alone.

// In a box from -1 to 1; the legend of the timeline draws the same ones.
const MARK_SHAPES = {
  lost: "M0-1L1 0 0 1-1 0z",
  map_changed: "M-.85-.85h1.7v1.7h-1.7z",
  stop: "M-.4-1h.8L1-.4v.8L.4 1h-.8L-1 .4v-.8z",
  recovery: "M-1 0a1 1 0 1 1 2 0a1 1 0 1 1-2 0zM-.45 0a.45.45 0 1 0 .9 0a.45.45 0 1 0-.9 0z",
  jump: "M0-1L1 .85h-2z",
  start: "M-.7-1L.9 0-.7 1z",
  finding: "M-.3-1h.6v.7h.7v.6h-.7v.7h-.6v-.7h-.7v-.6h.7z",
};
const INKS = [
  "paper", "ink", "soft", "rule", "free", "unknown", "wall", "belief", "hindsight", "odometry",
  "mapped", "appeared", "removed", "moving", "other", "particles", "plan", "cell-appeared",
  "cell-removed", "error", "warning", "info", "state-healthy", "state-lost", "state-map_changed",
  "state-lost_and_map_changed", "state-unobservable", "state-insufficient_data",
];
const HATCHES = {
  lost: "/", map_changed: ".", lost_and_map_changed: "x", unobservable: "-", insufficient_data: "|",
};

function inksOf(section) {
  const style = getComputedStyle(section);
  const inks = {};
  for (const name of INKS) inks[name] = style.getPropertyValue(`--r-${name}`).trim() || "#888";
  inks.font = style.fontFamily;
  return inks;
}

const pathOf = Object.fromEntries(Object.entries(MARK_SHAPES).map(([kind, d]) => [kind, new Path2D(d)]));

function drawMark(context, kind, x, y, size, inks, severity) {
  context.save();
  context.translate(x, y);
  context.scale(size, size);
  context.fillStyle = inks[severity] || inks.info;
  context.strokeStyle = inks.paper;
  context.lineWidth = 1.6 / size;
  context.stroke(pathOf[kind]);
  context.fill(pathOf[kind], "evenodd");
  context.restore();
}

// A tile of lines or dots over a state's colour.
function hatch(context, kind, colour, ratio) {
  const size = 8;
  const tile = document.createElement("canvas");
  tile.width = tile.height = size * ratio;
  const ink = tile.getContext("2d");
  ink.scale(ratio, ratio);
  ink.strokeStyle = ink.fillStyle = colour;
  ink.lineWidth = 1.3;
  const line = (x0, y0, x1, y1) => { ink.beginPath(); ink.moveTo(x0, y0); ink.lineTo(x1, y1); ink.stroke(); };
  if (kind === "/" || kind === "x") for (const d of [-size, 0, size]) line(d, size, d + size, 0);
  if (kind === "x") for (const d of [-size, 0, size]) line(d, 0, d + size, size);
  if (kind === "-") line(0, size / 2, size, size / 2);
  if (kind === "|") line(size / 2, 0, size / 2, size);
  if (kind === ".") for (const [x, y] of [[2, 2], [6, 6]]) { ink.beginPath(); ink.arc(x, y, 1.1, 0, 7); ink.fill(); }
  const pattern = context.createPattern(tile, "repeat");
  pattern.setTransform(new DOMMatrix().scale(1 / ratio));
  return pattern;
}

// Text that stays readable on whatever lies under it.
function haloed(context, text, x, y, inks, colour = inks.ink) {
  context.lineJoin = "round";
  context.lineWidth = 4;
  context.strokeStyle = inks.paper;
  context.strokeText(text, x, y);
  context.fillStyle = colour;
  context.fillText(text, x, y);
}

// A canvas as sharp as the screen: the context is scaled to CSS pixels.
function sharp(canvas) {
  const ratio = Math.min(window.devicePixelRatio || 1, 3);
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  const [w, h] = [Math.round(width * ratio), Math.round(height * ratio)];
  if (canvas.width !== w || canvas.height !== h) { canvas.width = w; canvas.height = h; }
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  return { context, width, height, ratio };
}
