"""Logs in memory of a robot whose belief, and whatever it is held against, err as they claim."""

import numpy as np

from slamreplay.bundle.manifest import Clock, Frames, Manifest, Role
from slamreplay.bundle.schema import TABLES
from slamreplay.bundle.tables import Table
from slamreplay.bundle.view import Bundle
from slamreplay.geometry import se2, se3
from slamreplay.geometry.covariance import ros_from_planar

SECOND = 1_000_000_000
SECONDS = 300
#: Of a belief, coupled and turned; it breathes from row to row.
COV = np.array([[2.5e-3, 6e-4, 3e-4], [6e-4, 4.9e-3, -5e-4], [3e-4, -5e-4, 6e-4]])
CAMERA = np.array([0.21, -0.07, 0.6])
TAGS = {
    "tag_1": np.array([4.1, 2.3, 0.7]),
    "tag_2": np.array([-3.2, 1.4, 2.4]),
    "tag_3": np.array([0.3, -3.6, -1.2]),
    "tag_4": np.array([2.0, 4.4, -2.2]),
}


def path(t_s):
    """(N, 3) a robot that never stands, at any heading, at about 0.5 m/s."""
    t = np.asarray(t_s, dtype=np.float64)
    x, y = 3.1 * np.sin(0.17 * t + 0.4), 2.3 * np.sin(0.23 * t)
    dx, dy = 0.527 * np.cos(0.17 * t + 0.4), 0.529 * np.cos(0.23 * t)
    return np.column_stack([x, y, np.arctan2(dy, dx)])


def ns(t_s):
    return np.rint(np.asarray(t_s) * SECOND).astype(np.int64)


def update_times(rng):
    t_s = np.arange(1.0, SECONDS - 1.0, 1.1)
    return t_s + rng.uniform(0.0, 0.3, len(t_s))


def rows(table, t_s, topic, **columns):
    t_ns = ns(t_s)
    whole = {**dict.fromkeys(("t_ns", "t_sensor_ns", "t_log_ns"), t_ns), "topic": topic, **columns}
    n = len(t_ns)
    return Table(TABLES[table], {k: [v] * n if np.ndim(v) == 0 else v for k, v in whole.items()})


def posed(xyyaw):
    position = np.column_stack([xyyaw[:, :2], np.zeros(len(xyyaw))])
    return {"position_xyz": position, "orientation_xyzw": se3.quaternion_from_yaw(xyyaw[:, 2])}


def belief(rng, told=1.0, at=path, t_s=None, size=1.0):
    """Table poses: errors of covariance `COV` that breathes, `size` times as large; sigma is
    claimed `told` times that."""
    t_s = update_times(rng) if t_s is None else t_s
    breath = size * (1.0 + 0.5 * np.sin(np.arange(len(t_s))))
    cov = COV * breath[:, None, None] ** 2
    white = rng.standard_normal((len(t_s), 3))
    xyyaw = at(t_s) + np.einsum("nij,nj->ni", np.linalg.cholesky(cov), white)
    return rows("poses", t_s, "/pose", frame_id="map", child_frame_id="base", source="/pose",
                covariance=ros_from_planar(cov * told**2), **posed(xyyaw))  # fmt: skip


def moving(parent, child, t_s, xyyaw):
    pose = posed(xyyaw)
    return rows("transforms", t_s, "/tf", parent_frame=parent, child_frame=child, is_static=False,
                translation_xyz=pose["position_xyz"],
                rotation_xyzw=pose["orientation_xyzw"])  # fmt: skip


def fixed(parent, child, xyyaw):
    return moving(parent, child, [0.0], np.asarray(xyyaw)[None]).replace(
        is_static=[True], topic=["/tf_static"]
    )


def odometry(at=path, seconds=SECONDS, hz=10):
    """The base in odom on tf, exact but for where and how it began."""
    t_s = np.arange(0.0, seconds, 1.0 / hz)
    return moving("odom", "base", t_s, se2.compose(np.array([-1.0, 2.0, 2.1]), at(t_s)))


def sightings(rng, tags, *, phase=0.07, hz=4.0, far=4.0, kind="fiducial", heading=True, at=path):
    """What a camera saw of tags within 4 m, with the noise a silent detector is taken to have."""
    t_s = np.arange(phase, SECONDS - 1.0, 1.0 / hz)
    found = []
    for name, place in tags.items():
        seen = se2.between(at(t_s), place)
        distance = np.hypot(seen[:, 0], seen[:, 1])
        near = distance < far
        sigma = np.column_stack([*[0.03 + 0.04 * distance] * 2, np.full(len(t_s), 0.1)])
        seen = (seen + sigma * rng.standard_normal(seen.shape))[near]
        pose = posed(se2.between(CAMERA, seen))
        if not heading:
            pose["orientation_xyzw"] = np.full((len(seen), 4), np.nan)
        found.append(rows("references", t_s[near], "/tags", frame_id="camera", child_frame_id=name,
                          kind=kind, covariance=np.full((len(seen), 36), np.nan),
                          **pose))  # fmt: skip
    return Table.concat(TABLES["references"], found).sorted_by_time()


def surveyed(rng, tags=TAGS, sigma=0.03):
    """Where a survey says that tags are, and the static transforms that say so."""
    told = {name: place + rng.normal(0.0, sigma, 3) for name, place in tags.items()}
    return [fixed("map", name, place) for name, place in told.items()]


def bundle(tables, *, roles=(), seconds=SECONDS):
    """A bundle of tables; those of one name are laid together."""
    by_name = {}
    for table in tables:
        by_name.setdefault(table.schema.name, []).append(table)
    whole = {name: Table.concat(TABLES[name], parts) for name, parts in by_name.items()}
    if "transforms" in whole:
        whole["transforms"] = Table.concat(
            TABLES["transforms"], [whole["transforms"], fixed("base", "camera", CAMERA)]
        )
    end = seconds * SECOND
    named = [("pose", "/pose"), ("covariance", "/pose"), *roles]
    return Bundle(
        Manifest(
            bundle_id="evidence", sources=[], options={}, start_ns=0, end_ns=end,
            clock=Clock(name="sensor", reason="test", knots=[(0, 0), (end, end)]),
            frames=Frames(map="map", odom="odom", base="base", tree=[]),
            roles=[Role(role=r, topic=t, type="t", messages=1, reason="r") for r, t in named],
            missing=[], maps=[], losses=[], tables={},
        ),
        whole,
        {},
    )  # fmt: skip


#: A robot that drives a closed way for 30 s and stands in its dock for 15 s, in turn.
CYCLE_S, DRIVE_S = 45.0, 30.0
DOCK = np.array([1.4, -0.6, 0.9])


def shuttle(t_s):
    """(N, 3) from the dock, round and back into it, again and again."""
    part = np.clip(np.mod(t_s, CYCLE_S) / DRIVE_S, 0.0, 1.0)
    turn = 2.0 * np.pi * part
    loop = np.column_stack([2.0 * np.sin(turn), 1.5 * (1.0 - np.cos(turn)), turn])
    return se2.compose(DOCK, loop)


def battery(t_s, states, name="battery"):
    """What a battery was told to be; the first state is that of the log's start."""
    return rows("health", t_s, "/battery_state", level=20, name=name, message=list(states))


def docking(rng, dockings, told=1.0, size=1.0, play=(0.02, 0.02, 0.035)):
    """A robot that docks so often; each time it stands a little otherwise in its dock."""
    seconds = int(dockings * CYCLE_S)
    offset = rng.standard_normal((dockings + 1, 3)) * np.array(play)

    def at(t_s):
        which = np.floor((np.asarray(t_s) + CYCLE_S - DRIVE_S / 2.0) / CYCLE_S).astype(int)
        return se2.compose(shuttle(t_s), offset[which])

    start = np.arange(dockings) * CYCLE_S
    t_s = np.sort(np.concatenate([start + s for s in (3.0, 9.0, 15.0, 21.0, 27.0, 29.5)]))
    told_s = np.sort(np.concatenate([[0.0], start + 1.0, start + DRIVE_S + 0.5]))
    states = ["charging", *["discharging", "charging"] * dockings]
    return [belief(rng, told, at, t_s, size), odometry(shuttle, seconds, 2),
            battery(told_s, states)]  # fmt: skip


def fixes(rng, T_map_earth, *, antenna=(0.3, -0.2), sigma=0.05, hz=2.0, frame="earth"):
    """Satellite fixes: each off by sigma, and all together by sigma."""
    t_s = np.arange(0.3, SECONDS - 1.0, 1.0 / hz)
    level = se2.transform_points(path(t_s), np.array(antenna)[None])[:, 0]
    bias = rng.normal(0.0, sigma, 2)
    xyz = np.column_stack([level + bias, np.full(len(t_s), 0.4)])
    xyz += rng.normal(0.0, sigma, xyz.shape) * np.array([1.0, 1.0, 0.0])
    back = np.linalg.inv(T_map_earth)
    cov = np.full((len(t_s), 6, 6), np.nan)
    cov[:, :3, :3] = np.eye(3) * sigma**2
    return rows("references", t_s, "/fix", frame_id=frame, child_frame_id="gps", kind="gnss",
                position_xyz=xyz @ back[:3, :3].T + back[:3, 3],
                orientation_xyzw=np.full((len(t_s), 4), np.nan),
                covariance=cov.reshape(-1, 36))  # fmt: skip


def odometry_topic(rng, topic, *, slip=0.05, hz=10, seconds=SECONDS, cov=None):
    """A topic of table odometry that misses `slip` of every five seconds' way, one sigma."""
    t_s = np.arange(0.0, seconds, 1.0 / hz)
    step = se2.between(path(t_s[:-1]), path(t_s[1:]))
    factor = 1.0 + slip * rng.standard_normal((seconds // 5 + 1, 3))
    step = step * factor[(t_s[:-1] // 5).astype(int)]
    out = np.zeros((len(t_s), 3))
    out[0] = [5.0, 1.0, -2.0]
    for i, one in enumerate(step):
        out[i + 1] = se2.compose(out[i], one)
    nan = np.full((len(t_s), 36), np.nan)
    return rows("odometry", t_s, topic, frame_id="odom_2", child_frame_id="base",
                pose_covariance=nan if cov is None else cov, twist_covariance=nan,
                linear_velocity_xyz=np.full((len(t_s), 3), np.nan),
                angular_velocity_xyz=np.full((len(t_s), 3), np.nan), **posed(out))  # fmt: skip
