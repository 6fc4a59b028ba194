// The map itself, as a picture of few colours, and what of it is not true.

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
