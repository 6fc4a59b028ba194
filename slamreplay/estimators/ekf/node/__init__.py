"""The planar part of robot_localization's `ekf_node`, with the inputs that its parameters choose.

Checked against its source (cra-ros-pkg/robot_localization: ekf.cpp, filter_base.cpp,
ros_filter.cpp, params/ekf.yaml). Where a replay differs: measurements are taken in the order of
their stamps, none comes late; z, roll and pitch are left out whether `two_d_mode` is set or not;
there is no control input.
"""
