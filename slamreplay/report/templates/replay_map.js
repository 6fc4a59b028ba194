// The map at one moment: ground, paths, scans at both poses, robots with what they claim to know.

const MAPPED = 1, APPEARED = 2, REMOVED = 3, MOVING = 4, OTHER = 5, REMOVED_UNSEEN = 6;
const MET_LAYERS = {
  [MAPPED]: "met-mapped", [APPEARED]: "met-appeared", [REMOVED]: "met-removed",
  [MOVING]: "met-moving", [OTHER]: "met-other", [REMOVED_UNSEEN]: "met-removed",
};
const SMALLEST_ROBOT = 8; // px: a robot in a large hall is still seen

function drawMap(player) {
  const { scene, view, inks, layers, t } = player;
  const { context, width, height } = sharp(player.map);
  view.width = width;
  view.height = height;
  if (!scene.head.window) return;
  if (view.fitted) fit(view, scene.head.window);
  const poses = posesAt(scene, t);
  const followed = poses.hindsight || poses.belief || poses.odometry;
  if (player.following && followed) { view.x = followed.x; view.y = followed.y; }
  context.fillStyle = inks[scene.ground && layers.has("map") ? "unknown" : "free"];
  context.fillRect(0, 0, width, height);
  context.font = `600 12px ${inks.font}`;
  context.textAlign = "left";
  context.textBaseline = "middle";
  if (scene.ground) drawGround(context, player);
  if (layers.has("changes")) drawRegions(context, player);
  for (const name of ["odometry", "hindsight", "belief"]) {
    if (layers.has(name)) drawPath(context, view, scene.tracks[name], t, inks[name], name === "belief");
  }
  if (layers.has("plan") && scene.plans) drawPlan(context, player);
  if (layers.has("particles") && scene.particles) drawParticles(context, player);
  drawScans(context, player);
  if (layers.has("stops")) drawStops(context, player);
  for (const name of ["odometry", "hindsight", "belief"]) {
    if (!poses[name] || !layers.has(name)) continue;
    if (layers.has("uncertainty")) drawUncertainty(context, player, name, poses[name]);
  }
  if (layers.has("belief") && layers.has("hindsight")) drawLink(context, player, poses);
  for (const name of ["odometry", "hindsight", "belief"]) {
    if (poses[name] && layers.has(name)) drawRobot(context, player, name, poses[name]);
  }
  if (player.measuring) drawMeasure(context, player);
  drawScaleBar(context, player);
}

function posesAt(scene, t) {
  return Object.fromEntries(Object.entries(scene.tracks).map(([name, track]) => [name, poseAt(track, t)]));
}

// One pixel for each cell, coloured once: painted again when colours or layers change.
function groundImage(player) {
  const { scene: { ground }, inks, layers } = player;
  const key = [inks.free, inks.wall, layers.has("changes"), layers.has("map")].join();
  if (player.ground && player.ground.key === key) return player.ground.image;
  const rgba = (css) => {
    const one = document.createElement("canvas").getContext("2d");
    one.fillStyle = css;
    one.fillRect(0, 0, 1, 1);
    return new Uint32Array(one.getImageData(0, 0, 1, 1).data.buffer)[0];
  };
  const base = ["unknown", "free", "wall"].map((name) => (layers.has("map") ? rgba(inks[name]) : 0));
  const [removed, appeared] = [rgba(inks["cell-removed"]), rgba(inks["cell-appeared"])];
  const shown = layers.has("changes");
  const colours = Array.from({ length: 16 }, (_, code) =>
    shown && code & 8 ? appeared : shown && code & 4 ? removed : base[code & 3] || 0);
  const image = document.createElement("canvas");
  image.width = ground.width;
  image.height = ground.height;
  const context = image.getContext("2d");
  const pixels = context.createImageData(ground.width, ground.height);
  const out = new Uint32Array(pixels.data.buffer);
  for (let row = 0; row < ground.height; row++) {
    const to = (ground.height - 1 - row) * ground.width; // row 0 of a map is its lowest
    const from = row * ground.width;
    for (let i = 0; i < ground.width; i++) out[to + i] = colours[ground.codes[from + i]];
  }
  context.putImageData(pixels, 0, 0);
  player.ground = { key, image };
  return image;
}

function drawGround(context, player) {
  const { view, scene: { ground } } = player;
  const image = groundImage(player);
  const [ox, oy, yaw] = ground.origin;
  context.save();
  context.translate(...toScreen(view, ox, oy));
  context.rotate(-yaw);
  context.scale(view.scale, view.scale);
  const top = ground.corner[1] + ground.height * ground.cell_m;
  context.imageSmoothingEnabled = ground.cell_m * view.scale < 1;
  context.imageSmoothingQuality = "high";
  context.drawImage(
    image, ground.corner[0], -top, ground.width * ground.cell_m, ground.height * ground.cell_m,
  );
  context.restore();
}

function drawRegions(context, player) {
  const { scene, view, inks } = player;
  const named = scene.head.regions.length <= 6 || view.scale > 25 ? Infinity : 6;
  scene.head.regions.forEach((region, k) => {
    const [x0, y0] = toScreen(view, region.box[0], region.box[3]);
    const [x1, y1] = toScreen(view, region.box[2], region.box[1]);
    context.lineWidth = 1.2;
    context.strokeStyle = inks.ink;
    context.setLineDash([2, 2.5]);
    context.strokeRect(x0 - 4, y0 - 4, x1 - x0 + 8, y1 - y0 + 8);
    context.setLineDash([]);
    if (region.from) {
      const [fx, fy] = toScreen(view, (region.from[0] + region.from[2]) / 2, (region.from[1] + region.from[3]) / 2);
      arrow(context, fx, fy, (x0 + x1) / 2, (y0 + y1) / 2);
    }
    if (k < named) haloed(context, region.name, x1 + 7, y0 - 3, inks);
  });
}

function arrow(context, x0, y0, x1, y1) {
  const angle = Math.atan2(y1 - y0, x1 - x0);
  context.beginPath();
  context.moveTo(x0, y0);
  context.lineTo(x1, y1);
  for (const turn of [2.6, -2.6]) {
    context.moveTo(x1, y1);
    context.lineTo(x1 + 8 * Math.cos(angle + turn), y1 + 8 * Math.sin(angle + turn));
  }
  context.stroke();
}

// What lies behind is strong, what lies ahead faint; the pen is lifted where no pose is known.
function drawPath(context, view, track, t, colour, dashed) {
  if (!track) return;
  const now = rowAt(track.t, t);
  context.strokeStyle = colour;
  context.lineJoin = "round";
  context.setLineDash(dashed ? [6, 3] : []);
  for (const [from, to, alpha, line] of [[now, track.t.length - 1, 0.28, 1.6], [0, now, 0.95, 2.2]]) {
    context.globalAlpha = alpha;
    context.lineWidth = line;
    context.beginPath();
    let [lastX, lastY] = [NaN, NaN];
    for (let i = Math.max(from, 0); i <= to; i++) {
      const px = view.width / 2 + (track.x[i] - view.x) * view.scale;
      const py = view.height / 2 - (track.y[i] - view.y) * view.scale;
      if (track.gap[i] || i === Math.max(from, 0)) context.moveTo(px, py);
      else if (Math.abs(px - lastX) + Math.abs(py - lastY) < 0.7) continue; // less than a pixel
      else context.lineTo(px, py);
      [lastX, lastY] = [px, py];
    }
    context.stroke();
  }
  context.globalAlpha = 1;
  context.setLineDash([]);
}

function drawPlan(context, player) {
  const { scene: { plans, head }, view, inks, t } = player;
  const row = rowAt(plans.t, t);
  if (row < 0) return;
  const n = plans.xy.shape[1];
  context.strokeStyle = inks.plan;
  context.lineWidth = 2.4;
  context.setLineDash([1, 4]);
  context.lineCap = "round";
  context.beginPath();
  for (let i = plans.first[row]; i < plans.first[row + 1]; i++) {
    const x = head.origin[0] + plans.xy[i] * head.point_m;
    const y = head.origin[1] + plans.xy[n + i] * head.point_m;
    context.lineTo(...toScreen(view, x, y));
  }
  context.stroke();
  context.setLineDash([]);
  context.lineCap = "butt";
}

function drawParticles(context, player) {
  const { scene: { particles, head }, view, inks, t } = player;
  const row = currentRow(particles, t);
  if (row < 0) return;
  const n = particles.xy.shape[1];
  const length = Math.min(Math.max(0.14 * view.scale, 4), 12);
  context.strokeStyle = inks.particles;
  context.globalAlpha = 0.55;
  context.lineWidth = 1.2;
  context.beginPath();
  for (let i = particles.first[row]; i < particles.first[row + 1]; i++) {
    const x = head.origin[0] + particles.xy[i] * head.point_m;
    const y = head.origin[1] + particles.xy[n + i] * head.point_m;
    const [px, py] = toScreen(view, x, y);
    const yaw = particles.turn[i] * head.turn_rad;
    context.moveTo(px, py);
    context.lineTo(px + length * Math.cos(yaw), py - length * Math.sin(yaw));
  }
  context.stroke();
  context.globalAlpha = 1;
}

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

function drawStops(context, player) {
  const { scene, view, inks } = player;
  context.textAlign = "center";
  context.font = `700 11px ${inks.font}`;
  for (const stop of scene.head.stops) {
    const [x, y] = toScreen(view, stop.x, stop.y);
    context.beginPath();
    context.arc(x, y, 9, 0, 2 * Math.PI);
    context.fillStyle = inks.ink;
    context.strokeStyle = inks.paper;
    context.lineWidth = 2;
    context.fill();
    context.stroke();
    context.fillStyle = inks.paper;
    context.fillText(String(stop.number), x, y + 0.5);
  }
  context.textAlign = "left";
  context.font = `600 12px ${inks.font}`;
}

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

function drawMeasure(context, player) {
  const { view, inks, measured, pointer } = player;
  const ends = measured.length === 1 && pointer ? [...measured, toMap(view, ...pointer)] : measured;
  context.strokeStyle = context.fillStyle = inks.ink;
  const cross = (x, y) => {
    context.beginPath();
    context.moveTo(x - 7, y); context.lineTo(x + 7, y);
    context.moveTo(x, y - 7); context.lineTo(x, y + 7);
    context.lineWidth = 4; context.strokeStyle = inks.paper; context.stroke();
    context.lineWidth = 1.6; context.strokeStyle = inks.ink; context.stroke();
  };
  if (ends.length < 2 && !pointer) cross(view.width / 2, view.height / 2);
  for (const end of ends) cross(...toScreen(view, end.x, end.y));
  if (ends.length < 2) return;
  const [[x0, y0], [x1, y1]] = ends.map((end) => toScreen(view, end.x, end.y));
  context.beginPath();
  context.moveTo(x0, y0);
  context.lineTo(x1, y1);
  context.lineWidth = 1.6;
  context.setLineDash([7, 4]);
  context.stroke();
  context.setLineDash([]);
  const text = distanceText(ends[0], ends[1]);
  const wide = context.measureText(text).width;
  const at = Math.min(Math.max((x0 + x1) / 2 - wide / 2, 8), view.width - wide - 8);
  label(context, text, at, Math.min(Math.max((y0 + y1) / 2 - 18, 14), view.height - 14), wide, inks);
}

function drawScaleBar(context, player) {
  const { view, inks } = player;
  const bar = scaleBar(view);
  const [x, y] = [14, view.height - 14];
  for (const [line, colour] of [[5, inks.paper], [2, inks.ink]]) {
    context.beginPath();
    context.moveTo(x, y - 5); context.lineTo(x, y); context.lineTo(x + bar.px, y); context.lineTo(x + bar.px, y - 5);
    context.lineWidth = line;
    context.strokeStyle = colour;
    context.stroke();
  }
  haloed(context, bar.text, x + bar.px + 8, y - 2, inks);
}
