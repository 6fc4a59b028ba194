"""A small log with something of every kind that a log of ours can hold, and how tables compare."""

import numpy as np

from slamreplay.bundle.schema import TABLES
from slamreplay.bundle.tables import Ragged

T0 = 1_700_000_000_000_000_000
STEP = 100_000_000
#: Planted in every name that a log can have; nothing may keep it.
SECRET = "acmezebra"


def _stamp(make, t_ns):
    return make("builtin_interfaces/msg/Time", sec=t_ns // 10**9, nanosec=t_ns % 10**9)


def everything(logs, *, name=f"{SECRET}_17.mcap", seconds=4.0, robot="", frame=""):
    """A robot drives straight on; `robot` and `frame` stand before topics' and frames' names."""
    make = logs.make

    def header(t_ns, frame_id):
        return make("std_msgs/msg/Header", stamp=_stamp(make, t_ns), frame_id=frame_id)

    def tf(t_ns, *edges):
        found = []
        for parent, child, x in edges:
            edge = make("geometry_msgs/msg/TransformStamped", child_frame_id=f"{frame}{child}")
            edge.header = header(t_ns, f"{frame}{parent}")
            edge.transform.translation.x = x
            edge.transform.rotation.z, edge.transform.rotation.w = np.sin(0.05), np.cos(0.05)
            found.append(edge)
        return make("tf2_msgs/msg/TFMessage", transforms=found)

    out = [("/tf_static", "tf2_msgs/msg/TFMessage", tf(T0, ("base_link", "laser", 0.2)), T0)]
    grid = make("nav_msgs/msg/OccupancyGrid", header=header(T0, f"{frame}map"))
    grid.info.resolution, grid.info.width, grid.info.height = 0.05, 40, 30
    grid.info.origin.position.x, grid.info.origin.orientation.w = -1.0, 1.0
    grid.data = np.random.default_rng(1).choice([0, 100, -1], 1200).astype(np.int8)
    out.append((f"{robot}/map", "nav_msgs/msg/OccupancyGrid", grid, T0 + 5))
    for k in range(int(seconds * 10)):
        t, x = T0 + k * STEP, 0.05 * k
        late = t + 3_000_000 + 1000 * k
        odom = make("nav_msgs/msg/Odometry", child_frame_id=f"{frame}base_link")
        odom.header = header(t, f"{frame}odom")
        odom.pose.pose.position.x, odom.pose.pose.orientation.w = x, 1.0
        odom.pose.covariance = (np.eye(6) * (1 + k) * 1e-4).ravel()
        odom.twist.twist.linear.x = 0.5 + 0.01 * (k % 3)
        odom.twist.covariance = (np.eye(6) * 1e-3).ravel()
        out.append((f"{robot}/odom", "nav_msgs/msg/Odometry", odom, late))
        out.append(
            (
                "/tf",
                "tf2_msgs/msg/TFMessage",
                tf(t, ("odom", "base_link", x), ("map", "odom", 0.01 * (k // 10))),
                late + 7,
            )
        )
        scan = make("sensor_msgs/msg/LaserScan", header=header(t, f"{frame}laser"))
        scan.angle_min, scan.angle_max, scan.angle_increment = -0.5, 0.5, 0.1
        scan.range_min, scan.range_max, scan.scan_time = 0.1, 10.0, 0.1
        scan.ranges = (
            np.array([np.inf, np.nan, 0.0, -np.inf, *np.linspace(1, 3, 7)], np.float32) + k
        )
        out.append((f"{robot}/scan", "sensor_msgs/msg/LaserScan", scan, late + 9))
        imu = make("sensor_msgs/msg/Imu", header=header(t, f"{frame}base_link"))
        imu.orientation_covariance[0] = -1.0
        imu.angular_velocity.z, imu.linear_acceleration.z = 0.001 * k, 9.8 + 0.01 * k
        imu.angular_velocity_covariance = (np.eye(3) * 1e-4).ravel()
        out.append((f"{robot}/imu", "sensor_msgs/msg/Imu", imu, late + 11))
        twist = make("geometry_msgs/msg/Twist")
        twist.linear.x = 0.5 + 0.001 * k
        out.append((f"{robot}/cmd_vel", "geometry_msgs/msg/Twist", twist, late + 13))
        joints = make("sensor_msgs/msg/JointState", header=header(t, ""))
        joints.name = ["left_wheel", f"{SECRET}_arm"]
        joints.position = np.array([0.1 * k, 0.2 * k])
        out.append((f"{robot}/joint_states", "sensor_msgs/msg/JointState", joints, late + 15))
        score = make("std_msgs/msg/Float32", data=0.5 + 0.01 * k)
        out.append((f"{robot}/amcl/reliability_score", "std_msgs/msg/Float32", score, late + 16))
        if k % 5 == 0:
            out += _now_and_then(make, header, robot, frame, t, x, k, late)
    return logs.write(name, sorted(out, key=lambda row: row[3]))


def _now_and_then(make, header, robot, frame, t, x, k, late):
    pose = make("geometry_msgs/msg/PoseWithCovarianceStamped", header=header(t, f"{frame}map"))
    pose.pose.pose.position.x, pose.pose.pose.orientation.w = x, 1.0
    pose.pose.covariance = (np.eye(6) * (2 + k) * 1e-3).ravel()
    kind = "geometry_msgs/msg/PoseWithCovarianceStamped"
    out = [(f"{robot}/amcl_pose", kind, pose, late + 17)]
    if k == 0:
        out.append((f"{robot}/initialpose", kind, pose, late + 18))
    cloud = make("nav2_msgs/msg/ParticleCloud", header=header(t, f"{frame}map"))
    for j in range(3):
        one = make("nav2_msgs/msg/Particle", weight=0.1 * j)
        one.pose.position.y, one.pose.orientation.w = 0.1 * j, 1.0
        cloud.particles.append(one)
    out.append((f"{robot}/particle_cloud", "nav2_msgs/msg/ParticleCloud", cloud, late + 19))
    costs = make("nav_msgs/msg/OccupancyGrid", header=header(t, f"{frame}odom"))
    costs.info.resolution, costs.info.width, costs.info.height = 0.1, 4, 3
    costs.info.origin.orientation.w = 1.0
    costs.data = np.arange(12, dtype=np.int8)
    name = f"{robot}/local_costmap/costmap"
    if k == 0:
        out.append((name, "nav_msgs/msg/OccupancyGrid", costs, late + 20))
    update = make("map_msgs/msg/OccupancyGridUpdate", header=header(t, f"{frame}odom"))
    update.x, update.y, update.width, update.height = 1, 1, 2, 1
    update.data = np.array([k, 100], dtype=np.int8)
    out.append((f"{name}_updates", "map_msgs/msg/OccupancyGridUpdate", update, late + 21))
    plan = make("nav_msgs/msg/Path", header=header(t, f"{frame}map"))
    for j in range(4):
        step = make("geometry_msgs/msg/PoseStamped", header=plan.header)
        step.pose.position.x, step.pose.orientation.w = x + j, 1.0
        plan.poses.append(step)
    out.append((f"{robot}/plan", "nav_msgs/msg/Path", plan, late + 22))
    line = make("rcl_interfaces/msg/Log", stamp=header(t, "").stamp, level=20)
    line.name, line.msg = f"{SECRET}_node", f"host {SECRET}-nuc says {k}"
    if k == 10:
        line.name, line.msg = "behavior_server", "Running spin"
    if k == 20:
        line.msg = f"emergency stop pressed at {SECRET} dock"
    out.append(("/rosout", "rcl_interfaces/msg/Log", line, late + 23))
    status = make("diagnostic_msgs/msg/DiagnosticStatus", name=f"{SECRET}: lidar",
                  message=f"serial {SECRET}{k}", hardware_id=f"{SECRET}-hw")  # fmt: skip
    status.level = 1
    told = make("diagnostic_msgs/msg/DiagnosticArray", header=header(t, ""), status=[status])
    out.append(("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray", told, late + 24))
    event = make("nav2_msgs/msg/BehaviorTreeStatusChange", timestamp=header(t, "").stamp,
                 node_name="BackUp", previous_status="IDLE", current_status="RUNNING")  # fmt: skip
    log = make("nav2_msgs/msg/BehaviorTreeLog", timestamp=header(t, "").stamp, event_log=[event])
    out.append((f"{robot}/behavior_tree_log", "nav2_msgs/msg/BehaviorTreeLog", log, late + 25))
    goal = make("action_msgs/msg/GoalStatus", status=2 if k < 20 else 4)
    goal.goal_info.goal_id.uuid = np.arange(16, dtype=np.uint8)
    goals = make("action_msgs/msg/GoalStatusArray", status_list=[goal])
    name = f"{robot}/spin/_action/status"
    out.append((name, "action_msgs/msg/GoalStatusArray", goals, late + 26))
    fix = make("sensor_msgs/msg/NavSatFix", header=header(t, f"{frame}gps"))
    fix.latitude, fix.longitude, fix.altitude = 48.1 + 1e-6 * k, 11.5, 500.0
    fix.position_covariance = np.diag([0.5, 0.6, 0.9]).ravel()
    fix.position_covariance_type = 3
    out.append((f"{robot}/gps/fix", "sensor_msgs/msg/NavSatFix", fix, late + 27))
    tag = make("apriltag_ros/msg/AprilTagDetection", id=np.array([7], np.int32), size=np.zeros(1))
    tag.pose.header = header(t, f"{frame}camera")
    tag.pose.pose.pose.position.z, tag.pose.pose.pose.orientation.w = 1.0 + 0.01 * k, 1.0
    seen = make("apriltag_ros/msg/AprilTagDetectionArray", header=tag.pose.header,
                detections=[tag])  # fmt: skip
    kind = "apriltag_ros/msg/AprilTagDetectionArray"
    out.append((f"{robot}/tag_detections", kind, seen, late + 28))
    return out


#: Tables of which more than the window's rows are written, for those rows hold in it.
CARRIED = ("transforms", "map_updates", "poses", "initial_poses", "costmaps", "costmap_updates")


def differences(a, b, window=None):
    """What differs between a bundle's tables and those of its cut, in words."""
    found = []
    for name, schema in TABLES.items():
        x, y = a.table(name), b.table(name)
        if window is not None:
            x = x.take(window.holds(x.t_ns))
            y = y.take(window.holds(y.t_ns)) if name in CARRIED else y
        if window is not None and name in ("transforms", "map_updates"):
            continue
        x, y = _ordered(x), _ordered(y)
        if len(x) != len(y):
            found.append(f"{name}: {len(x)} rows became {len(y)}")
            continue
        found += [f"{name}.{c.name}" for c in schema.columns if not _same(x[c.name], y[c.name])]
    return found


def _ordered(table):
    keys = [table[c.name].astype(str) for c in table.schema.columns if c.kind == "str"]
    return table.take(np.lexsort((*keys, table["t_sensor_ns"], table["t_log_ns"])))


def _same(p, q):
    if isinstance(p, Ragged):
        return np.array_equal(p.offsets, q.offsets) and np.allclose(
            p.values, q.values, rtol=0, atol=1e-12, equal_nan=True
        )
    if p.dtype == object:
        return bool((p == q).all())
    if p.dtype.kind == "f":  # through quaternions and latitudes
        return np.allclose(p, q, rtol=1e-12, atol=1e-9, equal_nan=True)
    return np.array_equal(p, q)
