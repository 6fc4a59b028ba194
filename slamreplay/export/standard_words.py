"""Words of names that say what a thing is and nothing of whose it is.

From REP-105 and REP-103 (frames), the topics, actions, behaviours and nodes of Nav2, AMCL,
move_base and the SLAM systems whose logs are read, and the words by which ingest tells roles
(`slamreplay.ingest.names`, `roles`). A word that could name a place, a maker or a model is not
here.
"""

from __future__ import annotations

_FRAMES = """
up down tilt pan mount track map odom odometry base link footprint earth world laser lidar imu
gps camera scan sensor optical frame wheel caster front rear back left right top bottom middle
center centre upper lower horizontal vertical
"""
_TOPICS = """
tf static clock rosout agg diagnostics diagnostic amcl mcl pose poses posestamped initialpose
initial set setpose cmd vel velocity command commands twist stamped stop plan plans path paths
trajectory route waypoint waypoints goal goals global local costmap raw updates update voxel
grid particle particles particlecloud cloud points point fix navsat gnss rtk magnetic field mag
joint joints state states battery status power supply robot data filtered unfiltered merged
slamreplay reference gt ground truth groundtruth mocap vicon vrpn optitrack qualisys natnet tag
tags apriltag apriltags aruco marker markers fiducial fiducials fid dock docking detected
detection detections staging reliability failure probability alpha likelihood score confidence
quality fitness transform nearest transformation localization localisation localizer localiser
estimate estimated kinematic slam toolbox graph visualization constraint constraints list info
ndt icp matching matcher match joy joystick teleop key keyboard nav mux target desired ref
setpoint odom combined ekf ukf parameter parameters events transition event
"""
_NODES = """
controller planner smoother behavior behaviour server navigator bt tree log lifecycle manager
move navigate to through monitor collision detector velocity recovery recoveries recoverys
action feedback result send get cancel service call context subtree navigation navfn dwb rotate
conservative aggressive reset slow and clear clearing entirely except around region entire spin
backup wait drive on heading assisted unstuck unstick reinitialize reinitialise actions
fallback recover node publisher driver follow exe undock charging retry costmaps
"""

STANDARD_WORDS = frozenset(f"{_FRAMES} {_TOPICS} {_NODES}".split())
