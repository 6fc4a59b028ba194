// The robot where it believed to be and where it was, and what it claimed to know.

const SMALLEST_ROBOT = 8; // px: a robot in a large hall is still seen

function drawUncertainty(context, player, name, pose) {
  const { scene, view, inks } = player;
  const claimed = ellipseAt(scene.tracks[name], pose.row);
  if (!claimed) return;
  const [x, y] = toScreen(view, pose.x, pose.y);
  context.strokeStyle = context.fillStyle = inks[name];
  context.lineWidth = 1.6;
  if (Number.isFinite(claimed.long)) {
    const k = CHI2_95 * view.scale;
    context.beginPath();
    context.ellipse(x, y, Math.max(k * claimed.long, 1), Math.max(k * claimed.short, 1), -claimed.bearing, 0, 2 * Math.PI);
    context.globalAlpha = 0.14;
    context.fill();
    context.globalAlpha = 0.9;
    context.setLineDash(name === "belief" ? [5, 3] : []);
    context.stroke();
    context.setLineDash([]);
  }
  if (Number.isFinite(claimed.heading)) {
    const half = Math.min(NORMAL_95 * claimed.heading, Math.PI);
    const radius = robotRadius(player) * 2.6 + 6;
    context.beginPath();
    context.moveTo(x, y);
    context.arc(x, y, radius, -pose.yaw - half, -pose.yaw + half);
    context.closePath();
    context.globalAlpha = 0.3;
    context.fill();
  }
  context.globalAlpha = 1;
}

function robotRadius({ scene, view }) {
  const reach = Math.max(...scene.head.footprint.map(([x, y]) => Math.hypot(x, y)));
  return Math.max(reach * view.scale, SMALLEST_ROBOT);
}

// The outline to scale, or as small as can be seen; the nose tells where it heads.
function drawRobot(context, player, name, pose) {
  const { scene, view, inks } = player;
  const [x, y] = toScreen(view, pose.x, pose.y);
  const radius = robotRadius(player);
  const reach = Math.max(...scene.head.footprint.map(([fx, fy]) => Math.hypot(fx, fy)));
  const grown = radius / reach;
  context.save();
  context.translate(x, y);
  context.rotate(-pose.yaw);
  context.beginPath();
  for (const [fx, fy] of scene.head.footprint) context.lineTo(fx * grown, -fy * grown);
  context.closePath();
  context.lineJoin = "round";
  context.lineWidth = 4.5;
  context.strokeStyle = inks.paper;
  context.stroke();
  context.fillStyle = name === "belief" ? inks.paper : inks[name];
  context.fill();
  context.lineWidth = 2.4;
  context.strokeStyle = inks[name];
  context.setLineDash(name === "belief" ? [4, 2.5] : []);
  context.stroke();
  context.setLineDash([]);
  context.beginPath();
  context.moveTo(0.78 * radius, 0);
  context.lineTo(-0.35 * radius, 0.5 * radius);
  context.lineTo(-0.1 * radius, 0);
  context.lineTo(-0.35 * radius, -0.5 * radius);
  context.closePath();
  context.fillStyle = name === "belief" ? inks[name] : inks.paper;
  context.fill();
  context.restore();
}

// The same moment at two places: how far apart they are is the whole story.
function drawLink(context, player, { belief, hindsight }) {
  if (!belief || !hindsight) return;
  const { view, inks, scene } = player;
  const [x0, y0] = toScreen(view, belief.x, belief.y);
  const [x1, y1] = toScreen(view, hindsight.x, hindsight.y);
  const lane = scene.lanes.find((one) => one.key === "error_m");
  const told = lane ? laneAt(lane, player.t) : null; // the same number as in the words
  const apart = told === null ? Math.hypot(belief.x - hindsight.x, belief.y - hindsight.y) : told;
  if (Math.hypot(x1 - x0, y1 - y0) < 6) return;
  context.strokeStyle = inks.paper;
  context.lineWidth = 4;
  context.beginPath();
  context.moveTo(x0, y0);
  context.lineTo(x1, y1);
  context.stroke();
  context.strokeStyle = inks.ink;
  context.lineWidth = 1.8;
  context.stroke();
  const seen = Math.min(x0, x1) < view.width && Math.max(x0, x1) > 0
    && Math.min(y0, y1) < view.height && Math.max(y0, y1) > 0;
  if (!seen || apart < 0.2 * ((lane && lane.limit) || 0.5)) return;
  context.font = `700 13px ${inks.font}`;
  const text = `${apart.toFixed(2)} m apart`;
  const [mx, my] = [(x0 + x1) / 2, (y0 + y1) / 2];
  const wide = context.measureText(text).width;
  const beside = Math.abs(y1 - y0) > Math.abs(x1 - x0);
  const [tx, ty] = beside ? [mx + 12, my] : [mx - wide / 2, Math.min(y0, y1) - robotRadius(player) - 16];
  label(context, text, Math.min(Math.max(tx, 6), view.width - wide - 6), Math.min(Math.max(ty, 12), view.height - 12), wide, inks);
  context.font = `600 12px ${inks.font}`;
}

function label(context, text, x, y, wide, inks) {
  context.fillStyle = inks.paper;
  context.strokeStyle = inks.ink;
  context.lineWidth = 1;
  context.beginPath();
  context.roundRect(x - 5, y - 11, wide + 10, 21, 4);
  context.globalAlpha = 0.92;
  context.fill();
  context.globalAlpha = 1;
  context.stroke();
  context.fillStyle = inks.ink;
  context.fillText(text, x, y + 0.5);
}
