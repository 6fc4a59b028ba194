// Numbers and moments in words; the same words for the eye, the slider and a screen reader.

const MARK_NAMES = {
  lost: "lost", map_changed: "map changed", stop: "stops", recovery: "recoveries",
  jump: "jumps", start: "initial poses", finding: "findings",
};

const UNDECIDED = ["insufficient_data", "unobservable"];

function digits(value) {
  if (value === null || !Number.isFinite(value)) return "-";
  const size = Math.abs(value);
  if (size >= 1e5) return value.toExponential(1);
  return value.toFixed(size >= 100 ? 0 : size >= 10 ? 1 : 2);
}

function laneText(lane, value) {
  if (value === null) return "-";
  if (lane.key === "changed_share") return `${(100 * value).toFixed(value < 0.1 ? 1 : 0)} %`;
  return `${digits(value)}${lane.unit ? ` ${lane.unit}` : ""}`;
}

function stateAt(scene, t) {
  const states = scene.head.states;
  return states.find(([, , from, to]) => from <= t && t < to) || states[states.length - 1] || null;
}

function clockText(t) {
  return `${t.toFixed(1)} s`;
}

// "42.3 s: belief off by 2.91 m and 12 deg; sigma 0.08 m; ...; robot lost"
function momentText(scene, t) {
  const known = {};
  for (const lane of scene.lanes) known[lane.key] = laneAt(lane, t);
  const parts = [];
  const state = stateAt(scene, t);
  if (known.error_m != null) {
    const turn = known.error_deg == null ? "" : ` and ${known.error_deg.toFixed(0)} deg`;
    const apart = `${known.error_m.toFixed(2)} m${turn}`;
    // Where nothing was decided, hindsight is no better a witness than the belief.
    const open = state && UNDECIDED.includes(state[0]);
    parts.push(open ? `belief and hindsight ${apart} apart, and neither is vouched for` : `belief off by ${apart}`);
  } else if (scene.tracks.belief && !poseAt(scene.tracks.hindsight, t)) {
    parts.push("where it really was is not known");
  } else if (scene.tracks.hindsight && !poseAt(scene.tracks.belief, t)) {
    parts.push("no belief was told");
  } else if (scene.tracks.odometry) parts.push("only odometry tells where it was");
  if (known.sigma_m != null) parts.push(`sigma ${digits(known.sigma_m)} m`);
  if (known.nees != null) parts.push(`NEES ${digits(known.nees)}`);
  if (known.changed_share != null) {
    parts.push(`${(100 * known.changed_share).toFixed(0)} % of beams contradict the map`);
  }
  if (state) parts.push(state[1].toLowerCase());
  // Stretches are told by the state already.
  const named = marksNear(scene, t, 0.06).filter((mark) => !["lost", "map_changed"].includes(mark.kind));
  for (const mark of named.slice(0, 3)) parts.push(mark.title);
  return `${clockText(t)}: ${parts.join("; ")}`;
}

function marksNear(scene, t, reach) {
  return scene.head.marks.filter((mark) => Math.abs(mark.t - t) <= reach);
}

function distanceText(from, to) {
  const [dx, dy] = [to.x - from.x, to.y - from.y];
  const bearing = (Math.atan2(dy, dx) * 180) / Math.PI;
  return `${Math.hypot(dx, dy).toFixed(2)} m, bearing ${bearing.toFixed(1)} deg`;
}
