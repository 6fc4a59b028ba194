"""A small simulator: worlds, a robot, its sensors and faults, and logs whose truth is known."""

from slamreplay.stage import callable_stage

#: Every scenario with what happens in it; the details stand in `scenarios`.
SCENARIOS = {
    "healthy": "A round through a warehouse as mapped; one person walks about.",
    "healthy_short": "The first 20 s of such a round, for the small sample files.",
    "people": "A crowd in the warehouse: many beams are blocked, nothing has changed.",
    "lost_robot": "The start pose given by hand is metres wrong, and the filter never recovers.",
    "wheel_slip": "The wheels spin on a wet floor; odometry counts metres that were not driven.",
    "kidnapped": "The robot is carried to another aisle while its wheels stand still.",
    "changed_aisle": "Pallets stand in the way and a rack is gone; the robot knows where it is.",
    "lost_in_changed_aisle": "A wrong start pose in a warehouse that has changed as well.",
    "corridor_100m": "One round of 100 m through the corridors of an office, back to the start.",
    "barcode_floor": "A drive unit on codes in the floor: some worn, some misread, none for 15 s.",
}

callable_stage(__name__)
