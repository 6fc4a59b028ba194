// The timeline: states, marks and lanes over one axis of time. What stands still is painted once.

const BAND = 20, ROW = 18, PLOT = 50, TITLE = 16, AXIS = 22, TOP = 4;
const GUTTER = 176, RIGHT = 10; // px; a narrow page has its titles above the plots instead
const NARROW = 620;

function lanesLayout(player, width) {
  const { scene } = player;
  const narrow = width < NARROW;
  const kinds = Object.keys(MARK_SHAPES).filter((kind) => scene.head.marks.some((m) => m.kind === kind));
  const left = narrow ? 8 : GUTTER;
  let y = TOP;
  const take = (height, title = 0) => { const top = y + title; y = top + height; return { top, height, title }; };
  const band = take(BAND);
  y += 4;
  const rows = kinds.map((kind) => ({ kind, ...take(ROW, narrow ? TITLE : 0) }));
  y += 4;
  const plots = scene.lanes.map((lane) => { const plot = { lane, ...take(PLOT, narrow ? TITLE : 0) }; y += 8; return plot; });
  const axis = take(AXIS);
  return { narrow, left, right: width - RIGHT, band, rows, plots, axis, height: y, width };
}

function lanesHeight(section, width) {
  const narrow = width < NARROW;
  const [rows, lanes] = [Number(section.dataset.rows), Number(section.dataset.lanes)];
  const title = narrow ? TITLE : 0;
  return TOP + BAND + 8 + rows * (ROW + title) + lanes * (PLOT + title + 8) + AXIS;
}

const timeToX = (layout, end, t) => layout.left + (t / end) * (layout.right - layout.left);
const xToTime = (layout, end, x) =>
  Math.min(Math.max(((x - layout.left) / (layout.right - layout.left)) * end, 0), end);

function drawLanes(player) {
  const { context, width, height, ratio } = sharp(player.lanes);
  if (!width || !height) return;
  const { scene, inks, t } = player;
  const key = [width, height, ratio, inks.paper, inks.ink, inks.belief].join();
  if (!player.course || player.course.key !== key) {
    const still = document.createElement("canvas");
    still.width = player.lanes.width;
    still.height = player.lanes.height;
    const ink = still.getContext("2d");
    ink.setTransform(ratio, 0, 0, ratio, 0, 0);
    const layout = lanesLayout(player, width);
    drawStill(ink, player, layout, ratio);
    player.course = { key, still, layout };
  }
  const { still, layout } = player.course;
  context.setTransform(1, 0, 0, 1, 0, 0);
  context.clearRect(0, 0, still.width, still.height);
  context.drawImage(still, 0, 0);
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  const end = scene.head.end_s || 1;
  if (player.hovered !== null) cursor(context, layout, timeToX(layout, end, player.hovered), inks.soft, 1, [3, 3]);
  cursor(context, layout, timeToX(layout, end, t), inks.ink, 2, []);
  drawValues(context, player, layout, player.hovered === null ? t : player.hovered, end);
}

function cursor(context, layout, x, colour, line, dash) {
  context.strokeStyle = colour;
  context.lineWidth = line;
  context.setLineDash(dash);
  context.beginPath();
  context.moveTo(x, 0);
  context.lineTo(x, layout.axis.top);
  context.stroke();
  context.setLineDash([]);
  if (line < 2) return;
  context.fillStyle = colour;
  context.beginPath();
  context.moveTo(x - 6, 0); context.lineTo(x + 6, 0); context.lineTo(x, 8);
  context.fill();
}

// The values at the cursor stand beside their titles, and as dots on their curves.
function drawValues(context, player, layout, t, end) {
  const { scene, inks } = player;
  context.textBaseline = "middle";
  const x = timeToX(layout, end, t);
  for (const plot of layout.plots) {
    const value = laneAt(plot.lane, t);
    const beyond = isBeyond(plot.lane, value);
    context.font = `700 13px ${inks.font}`;
    context.textAlign = layout.narrow ? "right" : "left";
    context.fillStyle = beyond ? inks.error : inks.ink;
    const text = `${laneText(plot.lane, value)}${beyond ? " !" : ""}`;
    if (layout.narrow) context.fillText(text, layout.right, plot.top - TITLE / 2);
    else context.fillText(text, 0, plot.top + PLOT - 9);
    if (value === null) continue;
    context.beginPath();
    context.arc(x, plotY(plot, value), 3.5, 0, 2 * Math.PI);
    context.fillStyle = beyond ? inks.error : inks.hindsight;
    context.strokeStyle = inks.paper;
    context.lineWidth = 1.5;
    context.fill();
    context.stroke();
  }
  context.textAlign = "left";
  const state = stateAt(scene, t);
  if (!state || layout.narrow) return;
  context.font = `700 13px ${inks.font}`;
  context.fillStyle = inks.ink;
  context.fillText(state[1], 0, layout.band.top + BAND / 2);
}

function isBeyond(lane, value) {
  if (value === null || lane.limit === null) return false;
  return lane.key === "match" ? value < lane.limit : value > lane.limit;
}

// What lies under the pointer, in words.
function lanesTip(player, x, y) {
  const { scene, course: { layout } } = player;
  const end = scene.head.end_s || 1;
  const t = xToTime(layout, end, x);
  const within = (part) => y >= part.top - part.title && y < part.top + part.height + 4;
  if (within(layout.band)) { const state = stateAt(scene, t); return `${clockText(t)}: ${state ? state[1] : ""}`; }
  const row = layout.rows.find(within);
  if (row) {
    const reach = (9 / (layout.right - layout.left)) * end;
    const marks = scene.head.marks.filter((mark) => mark.kind === row.kind
      && mark.t - reach <= t && t <= (mark.end === null ? mark.t : mark.end) + reach);
    return marks.slice(0, 3).map((mark) => `${clockText(mark.t)}: ${mark.title}`).join("\n") || clockText(t);
  }
  const plot = layout.plots.find(within);
  return plot ? `${clockText(t)}: ${plot.lane.title} ${laneText(plot.lane, laneAt(plot.lane, t))}` : clockText(t);
}
