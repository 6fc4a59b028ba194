// Scans at both poses; what a beam met is told by colour and by shape.

const MAPPED = 1, APPEARED = 2, REMOVED = 3, MOVING = 4, OTHER = 5, REMOVED_UNSEEN = 6;
const MET_LAYERS = {
  [MAPPED]: "met-mapped", [APPEARED]: "met-appeared", [REMOVED]: "met-removed",
  [MOVING]: "met-moving", [OTHER]: "met-other", [REMOVED_UNSEEN]: "met-removed",
};

// Each scan lies at the pose of its own time, not at that of the moment that is shown.
function drawScans(context, player) {
  const { scene, layers, inks, t } = player;
  for (const scans of scene.scans) {
    const row = currentRow(scans, t);
    if (row < 0) continue;
    const at = scans.t[row];
    const believed = poseAt(scene.tracks.belief, at);
    const real = poseAt(scene.tracks.hindsight, at) || poseAt(scene.tracks.odometry, at);
    if (believed && layers.has("scan-belief")) {
      context.globalAlpha = 0.75;
      drawPoints(context, player, scans, row, believed, () => true, inks.belief, "square", 2.4);
      context.globalAlpha = 1;
    }
    if (!real || !layers.has("scan-hindsight")) continue;
    const of = (...kinds) => (met) => kinds.includes(met) && layers.has(MET_LAYERS[met]);
    drawPoints(context, player, scans, row, real, of(OTHER), inks.other, "plus", 4.5);
    drawPoints(context, player, scans, row, real, of(MAPPED), inks.mapped, "dot", 3.6);
    if (layers.has("met-removed")) drawRays(context, player, scans, row, real);
    drawPoints(context, player, scans, row, real, of(MOVING), inks.moving, "triangle", 8);
    drawPoints(context, player, scans, row, real, of(REMOVED), inks.removed, "ring", 6);
    drawPoints(context, player, scans, row, real, of(APPEARED), inks.appeared, "framed", 6);
  }
}

function drawPoints(context, player, scans, row, pose, wanted, colour, shape, size) {
  const { view, scene: { head } } = player;
  const n = scans.met.length;
  const [cos, sin] = [Math.cos(pose.yaw) * head.end_m * view.scale, Math.sin(pose.yaw) * head.end_m * view.scale];
  const [ox, oy] = toScreen(view, pose.x, pose.y);
  const half = size / 2;
  context.fillStyle = context.strokeStyle = colour;
  context.beginPath();
  for (let i = row * scans.beams; i < (row + 1) * scans.beams; i++) {
    const met = scans.met[i];
    if (met === 0 || met === REMOVED_UNSEEN || !wanted(met)) continue;
    const [ex, ey] = [scans.ends[i], scans.ends[n + i]];
    const x = ox + cos * ex - sin * ey;
    const y = oy - sin * ex - cos * ey;
    if (shape === "square" || shape === "framed") context.rect(x - half, y - half, size, size);
    else if (shape === "plus") {
      context.moveTo(x - half, y); context.lineTo(x + half, y);
      context.moveTo(x, y - half); context.lineTo(x, y + half);
    } else if (shape === "triangle") {
      context.moveTo(x, y - half); context.lineTo(x + half, y + half); context.lineTo(x - half, y + half);
      context.closePath();
    } else { context.moveTo(x + half, y); context.arc(x, y, half, 0, 2 * Math.PI); }
  }
  if (shape === "plus") { context.lineWidth = 1; context.stroke(); return; }
  if (shape !== "dot" && shape !== "square") { // a rim below all of them: a crowd keeps its colour
    context.lineWidth = 2;
    context.strokeStyle = player.inks.ink;
    context.stroke();
  }
  context.fill();
}

// A beam that went through a wall that is gone: the whole ray tells of it, not its end.
function drawRays(context, player, scans, row, pose) {
  const { view, scene: { head } } = player;
  const n = scans.met.length;
  const [cos, sin] = [Math.cos(pose.yaw) * view.scale, Math.sin(pose.yaw) * view.scale];
  const [ox, oy] = toScreen(view, pose.x, pose.y);
  const place = (x, y) => [ox + cos * x - sin * y, oy - sin * x - cos * y];
  context.strokeStyle = player.inks.removed;
  context.lineWidth = 1.4;
  context.globalAlpha = 0.7;
  context.beginPath();
  for (let i = row * scans.beams; i < (row + 1) * scans.beams; i++) {
    if (scans.met[i] !== REMOVED && scans.met[i] !== REMOVED_UNSEEN) continue;
    context.moveTo(...place(scans.laser[0], scans.laser[1]));
    context.lineTo(...place(scans.ends[i] * head.end_m, scans.ends[n + i] * head.end_m));
  }
  context.stroke();
  context.globalAlpha = 1;
}
