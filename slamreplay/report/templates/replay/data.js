// What the page carries, unpacked and asked by time. The layout is told in slamreplay/report/replay/packing.py.

const ARRAY_TYPES = { uint8: Uint8Array, int16: Int16Array, int32: Int32Array, float32: Float32Array };
const HELD_S = 1.0; // a value this old still stands for the moment
const STOOD_S = 10.0; // a robot that did not move may be silent for so long
const CHI2_95 = Math.sqrt(5.991464547); // 95 % of two dimensions lie within so many sigmas
const NORMAL_95 = 1.959963985; // and of one

async function unpack(text) {
  const bytes = await inflated(fromBase64(text.trim()));
  const length = new DataView(bytes.buffer).getUint32(0, true);
  const head = JSON.parse(new TextDecoder().decode(bytes.subarray(4, 4 + length)));
  const arrays = {};
  let offset = 4 + length;
  for (const [name, type, ...shape] of head.arrays) {
    const size = shape.reduce((product, n) => product * n, 1);
    arrays[name] = fromPlanes(bytes, offset, size, ARRAY_TYPES[type]);
    arrays[name].shape = shape;
    offset += arrays[name].byteLength;
  }
  return { head, arrays };
}

function fromBase64(text) {
  if (Uint8Array.fromBase64) return Uint8Array.fromBase64(text);
  const raw = atob(text);
  const bytes = new Uint8Array(raw.length);
  for (let i = 0; i < raw.length; i++) bytes[i] = raw.charCodeAt(i);
  return bytes;
}

async function inflated(bytes) {
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

function fromPlanes(bytes, offset, size, Type) {
  const out = new Type(size);
  const width = Type.BYTES_PER_ELEMENT;
  const raw = new Uint8Array(out.buffer);
  for (let plane = 0; plane < width; plane++) {
    const from = offset + plane * size;
    for (let i = 0; i < size; i++) raw[i * width + plane] = bytes[from + i];
  }
  // Integers travel as steps; a typed array wraps as numpy did on the way in.
  if (width > 1 && Type !== Float32Array) for (let i = 1; i < size; i++) out[i] += out[i - 1];
  return out;
}

// The scene in metres, radians and seconds since the log's start.
function sceneOf({ head, arrays }) {
  const seconds = (name) => Float64Array.from(arrays[name], (ticks) => ticks * head.tick_s);
  const tracks = {};
  for (const name of head.tracks) tracks[name] = trackOf(name, head, arrays, seconds);
  const scans = head.lasers.map((laser, k) => ({
    laser,
    t: seconds(`scan${k}_t`),
    ends: arrays[`scan${k}_ends`],
    met: arrays[`scan${k}_met`],
    beams: arrays[`scan${k}_met`].shape[1],
  }));
  const lanes = head.lanes.map((lane, k) => ({
    ...lane, t: seconds(`lane${k}_t`), values: arrays[`lane${k}_v`],
  }));
  const groups = (name) => arrays[`${name}_t`] && {
    t: seconds(`${name}_t`), first: arrays[`${name}_first`],
    xy: arrays[`${name}_xy`], turn: arrays[`${name}_turn`],
  };
  const ground = head.ground && {
    ...head.ground, codes: arrays.ground, height: arrays.ground.shape[0], width: arrays.ground.shape[1],
  };
  return { head, tracks, scans, lanes, ground, particles: groups("clouds"), plans: groups("plans") };
}

function trackOf(name, head, arrays, seconds) {
  const pose = arrays[`${name}_pose`];
  const n = pose.shape[1];
  return {
    name,
    t: seconds(`${name}_t`),
    x: Float64Array.from({ length: n }, (_, i) => head.origin[0] + pose[i] * head.place_m),
    y: Float64Array.from({ length: n }, (_, i) => head.origin[1] + pose[n + i] * head.place_m),
    yaw: Float64Array.from({ length: n }, (_, i) => pose[2 * n + i] * head.heading_rad),
    gap: arrays[`${name}_gap`],
    ellipse: arrays[`${name}_ellipse`],
  };
}

// Row of the last time that is not later; -1 before the first.
function rowAt(times, t) {
  let low = 0;
  let high = times.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (times[middle] <= t + 1e-9) low = middle + 1;
    else high = middle;
  }
  return low - 1;
}

// Rows lie so far apart as a rule; thinned ones stand for longer than whole ones.
function heldFor(series) {
  if (series.held === undefined) {
    const steps = Array.from(series.t.subarray(1), (t, i) => t - series.t[i]).sort((a, b) => a - b);
    series.held = Math.max(HELD_S, 2.5 * (steps[steps.length >> 1] || 0));
  }
  return series.held;
}

function currentRow(series, t) {
  const row = rowAt(series.t, t);
  return row >= 0 && t - series.t[row] <= heldFor(series) ? row : -1;
}

// Pose at a time, between two rows unless the path has a gap there; null where it is not known.
function poseAt(track, t) {
  if (!track) return null;
  const k = rowAt(track.t, t);
  if (k < 0) return null;
  const pose = { x: track.x[k], y: track.y[k], yaw: track.yaw[k], row: k };
  const age = t - track.t[k];
  if (k + 1 >= track.t.length || age <= 1e-9) return age <= HELD_S ? pose : null;
  const span = track.t[k + 1] - track.t[k];
  const step = [track.x[k + 1] - pose.x, track.y[k + 1] - pose.y, wrapped(track.yaw[k + 1] - pose.yaw)];
  const stood = Math.hypot(step[0], step[1]) <= 0.05 && Math.abs(step[2]) <= 0.05 && span <= STOOD_S;
  if (track.gap[k + 1] || !(stood || span <= heldFor(track))) return age <= HELD_S ? pose : null;
  const part = age / span;
  pose.x += part * step[0];
  pose.y += part * step[1];
  pose.yaw = wrapped(pose.yaw + part * step[2]);
  return pose;
}

function ellipseAt(track, row) {
  if (!track.ellipse) return null;
  const n = track.t.length;
  const [long, short, bearing, heading] = [0, 1, 2, 3].map((k) => track.ellipse[k * n + row]);
  return { long, short, bearing, heading };
}

function laneAt(lane, t) {
  const row = currentRow(lane, t);
  return row < 0 || !Number.isFinite(lane.values[row]) ? null : lane.values[row];
}

function wrapped(angle) {
  return angle - 2 * Math.PI * Math.floor((angle + Math.PI) / (2 * Math.PI));
}
