"""A check's answer, and the catalogue of what findings mean.

Long, because the catalogue is: one entry for each finding, and nothing that computes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Severity = Literal["info", "warning", "error"]
SEVERITIES: tuple[Severity, ...] = ("info", "warning", "error")


@dataclass(frozen=True)
class Finding:
    """One answer with its numbers; unknown numbers are None.

    Attributes:
        id: stable id; `FINDINGS` holds its title and meaning.
        severity: info, warning or error.
        message: one sentence with the numbers in it.
        start_ns: first moment it holds for, on the bundle's clock.
        end_ns: last moment.
        value: the number that was judged, with `low` and `high` the interval it was judged by.
        unit: unit of these numbers.
        n: samples.
        n_eff: effective samples, after autocorrelation.
        p_value: of data at least this odd from a consistent belief; None where nothing was tested.
        p_adjusted: the same after Holm's correction over all tests of the log.
    """

    id: str
    severity: Severity
    message: str
    start_ns: int | None = None
    end_ns: int | None = None
    value: float | None = None
    low: float | None = None
    high: float | None = None
    unit: str = ""
    n: int | None = None
    n_eff: float | None = None
    p_value: float | None = None
    p_adjusted: float | None = None

    @property
    def title(self) -> str:
        """The short name of what was found."""
        return FINDINGS[self.id].title


@dataclass(frozen=True)
class Explanation:
    """What a finding asks, how it is computed, and when it misleads: `slamreplay explain ID`."""

    title: str
    asks: str
    method: str
    misleads: str


FINDINGS: dict[str, Explanation] = {
    "SR-LOC-001": Explanation(
        "The robot was lost",
        "Was the belief farther from where the robot really was than the limit, for long enough?",
        "Belief minus hindsight at every scan; more than 0.5 m or 20 deg for 3 s or longer.",
        "Where hindsight itself is wrong: look at its coverage and at the observability margin.",
    ),
    "SR-LOC-002": Explanation(
        "More than one place explains the log",
        "Does a different place explain all scans, or those of one stretch, as well as the best?",
        "Mean score per scan of the best sequence of places against the best different one, over "
        "the whole log, and of each stretch's place against its best different one.",
        "A symmetric building is honestly ambiguous; a short log may be so without symmetry.",
    ),
    "SR-LOC-003": Explanation(
        "No belief to judge",
        "Did a localizer publish map->odom or a pose?",
        "Neither a transform between the map and odometry frames nor a pose topic was recorded.",
        "Recorded under an unusual type or name: give the topic in a topics file.",
    ),
    "SR-LOC-004": Explanation(
        "Moments that cannot be judged",
        "Does hindsight know where the robot was well enough to judge the belief?",
        "No pose, a standard deviation larger than the limit, or a scan that the map explains far "
        "worse than the log's typical one; longer than 1 s.",
        "Heavy changes lower the match as well; beams known to have changed are not counted.",
    ),
    "SR-LOC-005": Explanation(
        "The belief jumped",
        "Did the belief step as odometry did not, and which measurement made it?",
        "From row to row of its path, belief against the belief before it carried on by odometry: "
        "0.2 m or 10 deg is worth a word, 0.5 m or 20 deg a warning unless a pose was given then "
        "or the best reference (hindsight, where there is no other) says it led home. Of a run the "
        "cause is the row of its residual ledger that moved it most in between, where that is half "
        "of the jump at least. A recorded localizer leaves no ledger: named is what the log holds "
        "near it (closures of a SLAM graph, given poses, tags seen anew, relocalizations, maps, "
        "jumps of odometry), how long it was silent, and whether its particles stood there.",
        "What lies near in time need not be the cause. A right correction is as large as the error "
        "before it. Without odometry nothing tells a jump from driving.",
    ),
    "SR-MAP-001": Explanation(
        "The aisle had changed",
        "Do beams, cast from where the robot really was, contradict the map and stay that way?",
        "Changed beams over valid beams: more than 8 % for 2 s or longer; people do not count.",
        "Hindsight off by more than 0.25 m makes walls look moved; glass and mirrors do so always.",
    ),
    "SR-MAP-002": Explanation(
        "No map to judge against",
        "Is there a map in the log or on the command line?",
        "No occupancy grid topic and no --map.",
        "A map that was recorded before the log was cut: give it with --map.",
    ),
    "SR-MAP-003": Explanation(
        "The map was exchanged during the log",
        "Did more than one version of the map hold, one after the other?",
        "Versions of the map topic (whole grids, and windows laid over them) by their time. The "
        "robot is placed in the last version of a place, each moment's beams are compared with the "
        "version that held then. Versions are of one place if they share the frame and no more "
        "than a fifth of the faces of their walls stands otherwise by over 0.25 m, unmapped space "
        "apart; where that is not so each stretch of 10 s or more is judged in its own map. "
        "Changed cells are drawn in the last map.",
        "A mapper that closes a loop bends its map: the older version counts as another place "
        "then. What it drew late or in vain is no change where nothing was seen to come or go.",
    ),
    "SR-MAP-FRAME": Explanation(
        "The map's frame is shifted",
        "Is the belief off by one constant transform over the whole log?",
        "Spread of belief against hindsight: constant offset, self-consistent belief.",
        "A wrong start that was never corrected looks the same; both are then named.",
    ),
    "SR-MAP-WRONG": Explanation(
        "The map is of another place",
        "Do the scans fit anywhere in the map?",
        "The best sequence of places explains too few beams; or it explains clearly more once the "
        "scans are laid out at another scale, which is then named.",
        "A building that was rebuilt altogether.",
    ),
    "SR-CON-001": Explanation(
        "The covariance does not match the error",
        "Is the normalised estimation error squared what a consistent estimator would show?",
        "NEES e' (P + P_source)^-1 e of every update of the belief, its mean against the 95 % "
        "interval for the effective number of samples (Bar-Shalom, Li, Kirubarajan 2001, section "
        "5.4), too small and too large alike, one test for each source: poses of a reference; tags "
        "and docks with a surveyed place, and satellite fixes tied to the map, to which the belief "
        "carries what was sensed; tags, docks and charging against where they were at the visits "
        "before. Where no reference tells, hindsight and a second odometry, against which only a "
        "factor of 2 counts. Where position and heading are not coupled, as in AMCL, they are "
        "judged apart; a heading whose variance is beyond pi^2 / 3, uniform over the circle, is "
        "not known and left out. A belief whose height, roll and pitch and their variances change, "
        "against a reference in space: position and rotation vector, six axes.",
        "Of all sources but poses of a reference the covariance is only a bound: sigma may be "
        "found too small, by at least the factor, and never right or too large. A tag that was "
        "moved, one whose heading flips, a camera whose mount is off, or charging by hand looks "
        "like an error of the belief. AMCL's mean and covariance may come from different clusters: "
        "SR-CON-011 where the log has its particles.",
    ),
    "SR-CON-002": Explanation(
        "Covariances that are none",
        "Are the published covariances finite, symmetric and positive definite?",
        "Rows whose x y yaw block fails the test, counted; they are left out of NEES.",
        "Some localizers publish zero covariance on purpose until they are initialised.",
    ),
    "SR-CON-003": Explanation(
        "Consistency could not be decided",
        "Was there enough independent evidence to hold the covariance against an error?",
        "Refused without a source or a covariance, in frames that nothing independent ties, where "
        "the belief is made of what it would be held against, or below 20 effective samples. A "
        "source whose covariance is only a bound decides nothing where it accuses nobody.",
        "Undecided is neither consistent nor inconsistent.",
    ),
    "SR-CON-004": Explanation(
        "The errors are not distributed as the covariance says",
        "Do the ellipses of 50, 68, 90, 95 and 99 % hold as many of the errors as they claim?",
        "u = F(e' P^-1 e) with the chi-square distribution function F, which is uniform where the "
        "covariance is right, against the uniform distribution after Kolmogorov and Smirnov "
        "(Stephens 1974), for the effective number of samples. The same after the errors were "
        "divided by their own scale tells a wrong scale, which SR-CON-001 is about, from a wrong "
        "shape.",
        "A constant offset makes all errors alike in size, and so does a reference that is off. "
        "Sources that share evidence with the belief are shown and never accuse.",
    ),
    "SR-CON-005": Explanation(
        "The covariance is not credible",
        "Is the claimed covariance the actual mean square error matrix, in every direction?",
        "Noncredibility index NCI = 10/N sum |log10 rho| and inclination I2 = 10/N sum log10 rho, "
        "rho = e' P^-1 e / e' P*^-1 e with the actual matrix P* (Li and Zhao 2006); 3 dB are a "
        "factor of 2 in the variance, I2 above 0 is too small. P* is the second moment of the "
        "whitened errors; likelihood ratio tests say whether it is the claimed one, and whether "
        "one factor would mend it (Rencher and Christensen 2012, section 7.2).",
        "P* comes from the same log, and takes all rows to be off by the same factors; with few "
        "effective samples the index is never quite zero.",
    ),
    "SR-CON-006": Explanation(
        "Innovations are not as large as predicted",
        "Are measured minus predicted values as large as the filter's own S = H P H' + R says?",
        "Mean of r' S^-1 r by source, and of r_i^2 / S_ii by axis (Bonferroni), against the "
        "chi-square interval for the effective number of samples (Bar-Shalom, Li, Kirubarajan "
        "2001, section 5.4.2). Only what the update used is tested; where its gate cut off by NIS, "
        "against the chi-square without what lies beyond. Rejected ones are counted against the "
        "chance of the gate. Only of estimators that predict them: a recorded localizer, a matcher "
        "or a pose graph has no S of its own.",
        "Whether R or Q is to blame it cannot tell: see SR-CON-007. Scaling both by the factor "
        "makes S fit. Where SR-CON-007 is raised too, innovations may be small although the "
        "belief is far too sure of itself. A gate far out of tune lets through what fits it.",
    ),
    "SR-CON-007": Explanation(
        "Innovations hang together in time",
        "Is each innovation (those of SR-CON-006) new, or does it follow from the ones before?",
        "Squared autocorrelations of the whitened innovations of each axis at lags 1 to "
        "min(10, n / 5), in order of time, added up as by Ljung and Box (1978, Biometrika 65, "
        "297-303), each over its variance as found, so that a sigma that is wrong for a stretch "
        "is no correlation (Dalla, Giraitis, Phillips 2022, Econometric Theory 38). Too small a "
        "gain leaves positive correlation, too large a one negative (Mehra 1970, IEEE Trans. "
        "Automatic Control 15, 175-184). Below 0.1 it changes little and is told as info.",
        "Lags are counted in innovations, not in seconds: several things seen in turn, each with "
        "an error of its own, show at the lag of their number.",
    ),
    "SR-CON-008": Explanation(
        "A sensor measures too much or too little",
        "Is measured minus predicted (the innovations of SR-CON-006) zero on average?",
        "Student's t of the mean of each axis, with effective samples (n over the integrated "
        "autocorrelation time) for samples. How grave it is goes by its size in sigmas of the "
        "innovation: below 0.2 it is lost in the noise, however sure it is.",
        "A filter that leans on the sensor takes over part of its bias: the true one is larger "
        "then. An error of the survey, of the mount or of odometry looks the same. Things seen "
        "from one side only turn a lateness into a bias.",
    ),
    "SR-CON-009": Explanation(
        "Scans are not as likely as the particle filter predicts",
        "Do scans look like those that the filter's own cloud and laser model would give?",
        "A particle filter has no S. At each update 19 particles are drawn from the cloud after "
        "its motion and before the scan, and a scan for each: beams at the map's first wall with "
        "noise of sigma_hit, or, z_rand of (z_hit + z_rand) of them, anywhere. The rank of the "
        "real scan's likelihood (mean over the cloud of the product of the field's values) among "
        "them is even if cloud and model are right; counted is the lowest twentieth (binomial). "
        "Only for the replayed amcl: a recorded localizer leaves no cloud to draw from.",
        "A likelihood field is no model of ranges: that draws stand for it is a label, not its "
        "derivation. A changed map and crowds make scans unlikely as well: then it is the world. "
        "nav2's default (half of the beams random, 0.2 m) predicts nearly everything: robots that "
        "were lost for minutes gave ranks near the top. Silence proves nothing there, and "
        "SR-CON-003 says so.",
    ),
    "SR-CON-010": Explanation(
        "The covariance collapsed",
        "From when on did sigma shrink or stand while the error grew, or shrink for no reason?",
        "Errors of position and of heading against each independent source (else the best of those "
        "that share evidence), whitened: windows of 4, 8, 16 ... updates whose mean square is held "
        "against chi-square of their independent samples; p times the windows looked at "
        "(Bonferroni scan, Walther 2022, arXiv:2107.08296). Onset and end by the largest sum of "
        "log-likelihood ratios (Page 1954, Biometrika 41). A belief that is too sure of itself all "
        "the time is SR-CON-001's. Facts: sigma smaller by a fifth although nothing was sensed or "
        "taken in; sigma below r / sqrt(12 N) of N beams in a map of cells r (the bound of Censi "
        "2007, On achievable accuracy for range-finder localization), less what sightings and "
        "fixes add. One finding for all that overlap; its value is the factor by which sigma was "
        "too small, or shrank.",
        "A reference that jumps, or whose clock is off, makes any belief look too sure. What "
        "shares evidence with the belief proves nothing where it is silent. A localizer may have "
        "used sensors that are not in the log, and a smoother what came later. The floor takes the "
        "map's cells as all that is known of walls.",
    ),
    "SR-CON-011": Explanation(
        "Mean and covariance do not belong together",
        "Are the published mean and covariance those of the same particles?",
        "Each update against the nearest cloud within 0.5 s in the same frame: its clusters (cells "
        "of 0.5 m and 10 deg that touch, as nav2_amcl makes them), mean and covariance of the "
        "whole and of each cluster with a tenth of the weight, the heading's variance -2 ln R. "
        "The mean one cluster's and the covariance the whole's, or the other way round: such rows "
        "are left out of NEES; where they are most, all are. Of a replayed AMCL by its own count.",
        "A cloud that is merely thin falls into clusters as well; it counts only where the two "
        "means and the two covariances differ. Without a cloud in the log nothing is seen.",
    ),
    "SR-REF-001": Explanation(
        "What the robot sensed joined hindsight",
        "Which tags, docks and satellite fixes are part of the rebuilt trajectory?",
        "Sightings of things that stand still and positions of the antenna, with robust noise in "
        "the pose graph; places that nobody surveyed are estimated with the trajectory. --hold-out "
        "KIND keeps a kind out, so that it judges instead.",
        "A tag on something that moves, or two tags of one number: both are given up where the "
        "scans say otherwise.",
    ),
    "SR-REF-002": Explanation(
        "What was held out judges hindsight",
        "How far are sightings and fixes that hindsight did not use from where it puts them?",
        "Each sighting carried by hindsight's pose, against the thing's surveyed place or else "
        "their median; satellite fixes after one rigid alignment.",
        "It holds the sensor's own noise and the error of where it is mounted as well.",
    ),
    "SR-CLK-001": Explanation(
        "Clocks disagree",
        "Do header stamps and log times tell the same story?",
        "Median offset of log time minus header stamp; its drift is the Theil-Sen slope of the "
        "least delays of 30 windows, for a delay can only grow, with jumps taken out.",
        "Simulated time is meant to differ; replayed bags carry the old stamps. Another computer's "
        "clock and a long way to the recorder look the same.",
    ),
    "SR-CLK-002": Explanation(
        "Scans and odometry do not share a clock",
        "Do scans, laid on the map, turn when odometry says so?",
        "In every turn the lag of the scans' heading behind odometry's is regressed on the turn "
        "rate, beside a constant, a drift and a scale error; robust mean over the turns. The IMU, "
        "or the odometry topic where tf was compared, says which of the two is late.",
        "Fewer than two turns tell nothing. Steady turning alone tells a delay from a scale error "
        "badly; the sigma says so. Deskewing by a wrong time_increment adds half a sweep.",
    ),
    "SR-CLK-003": Explanation(
        "A clock jumped",
        "Did stamps move against the log time at one message, and stay there?",
        "A step of the delay beyond 8 times the usual one and 30 ms that brings most of a change "
        "of its level (low delays of 3 s before and after); a raised level must last 30 s, or "
        "the recorder only stalled.",
        "Simulated time that was paused looks the same; so does a driver restarted with another "
        "latency.",
    ),
    "SR-CLK-004": Explanation(
        "Topics are on different clocks",
        "Do all sensors, transforms and poses carry stamps of one clock?",
        "Median of stamp minus log time carried over to the bundle's clock: more than 1 s for "
        "sensors, 15 s for transforms and poses, which a localizer may date ahead. What lies off "
        "by more than 5 s (15 s) is placed by its log time.",
        "A sensor that is really late by a second cannot be told from one whose clock is; where "
        "scans and odometry differ, SR-CLK-002 says by how much.",
    ),
    "SR-CLK-005": Explanation(
        "Stamps that cannot be",
        "Are there zero stamps, stamps that go back or repeat, or that are later than the log "
        "time?",
        "Counted in the order of the log times, by topic and on tf by edge. Later than the log "
        "time: all of a topic by 5 ms and 3 times its jitter, or single ones by 20 ms.",
        "A recorder that rounds its times down, or runs on another computer, makes sound stamps "
        "look late; some drivers hand scans on in another order than they were taken.",
    ),
    "SR-CLK-006": Explanation(
        "Gaps in a sensor's stream",
        "Did each sensor speak at its own rate all the time?",
        "Intervals of five periods and 0.25 s or longer, on the bundle's clock; missing messages "
        "are counted by the periods that intervals span. Only streams that keep a rate.",
        "A sensor that was switched off on purpose; a recorder that dropped messages looks the "
        "same as a driver that did.",
    ),
    "SR-CLK-007": Explanation(
        "A transform is dated ahead on purpose",
        "Do a transform's stamps lie a constant in front of what it was made from?",
        "Each stamp minus the lead is the stamp of a scan, to the millisecond, in 80 of 100 "
        "(AMCL: transform_tolerance, 1.0 s by default); else the lead over the log time is "
        "constant.",
        "No fault: other nodes can use the transform until the next one comes. A lead over the log "
        "time alone may be a clock that runs ahead.",
    ),
    "SR-TF-001": Explanation(
        "The tf tree is not one",
        "Has every frame one parent, without a cycle, and every fixed transform one value?",
        "Edges as they were published; of several parents the one stays that connects more, a "
        "cycle loses its thinnest edge, of several fixed values the last one holds.",
        "A robot description that was changed while the log ran, on purpose.",
    ),
    "SR-TF-002": Explanation(
        "Two publishers of one transform",
        "Does a transform go back and forth between two values?",
        "Samples in the order they were recorded that lie beyond 2 cm and 4 usual steps from both "
        "neighbours, which agree with each other to half of that; five times and in 2 of 100.",
        "One publisher that cannot decide between two answers, as a localizer between two places.",
    ),
    "SR-TF-003": Explanation(
        "Transforms were not there for scans",
        "Was there, for each scan, a transform before and after it, close by, and in time?",
        "Moving edges between odometry and the laser at the scan's stamp: outside of their "
        "samples, between two that are five periods apart, recorded more than 0.2 s after the "
        "scan, or forgotten by tf2's buffer of 10 s.",
        "What waited in the recorder waited less on the robot. Scans at the ends of a log have no "
        "transform because it was cut there.",
    ),
    "SR-TF-004": Explanation(
        "Odometry jumps",
        "Does odometry make steps that no robot can?",
        "Steps beyond three times the median speed of the ten around, plus 10 m/s2 (20 rad/s2) "
        "over half the square of the time, plus 5 cm (0.1 rad). REP-105 has odom -> base "
        "continuous.",
        "Odometry that was set to zero on purpose; visual odometry of low rate.",
    ),
    "SR-TF-005": Explanation(
        "Large corrections",
        "How far did each word of the localizer move the robot in the map?",
        "T_map_base with the new and the old map -> odom at the same T_odom_base: at the robot, "
        "not at the odometry frame's origin, which a small turn moves far.",
        "The robot was told its pose, or found itself again: a right correction is as large as the "
        "error before it.",
    ),
    "SR-TF-006": Explanation(
        "Frames that hang nowhere",
        "Are all frames that messages name tied to the robot by tf?",
        "Frames of scans, points, IMU, odometry, poses and maps without a path to the base.",
        "Fixed transforms that were latched before the recorder began are not in the log.",
    ),
    "SR-ODO-001": Explanation(
        "Odometry and the robot moved otherwise",
        "Did the wheels count a motion that the robot did not make, or miss one that it made?",
        "Motions over one second, odometry against hindsight, calibration errors taken out; 0.15 m "
        "or 6 deg in a second and 0.25 m or 8 deg in all. Way counted against way made names it: "
        "translational, sideways or rotational slip, or a robot that was carried.",
        "Where hindsight jumps to another place in error this looks the same: see its coverage.",
    ),
    "SR-ODO-002": Explanation(
        "Odometry is not calibrated",
        "Does odometry count too much or too little all along?",
        "Medians over all seconds of motion of way and turn counted over way and turn made "
        "(hindsight), and of the turn it invents per metre of straight way.",
        "A floor that slips everywhere is no different from a wrong wheel diameter.",
    ),
    "SR-ODO-003": Explanation(
        "Motion is told in another unit or hand",
        "Do odometry, gyroscope and commands tell the same turns and the same way?",
        "Rates over the steps of odometry: medians of odometry over gyroscope, odometry over "
        "command and gyroscope over command, of steps in which the divisor turns by more than "
        "0.15 rad/s or drives more than 0.1 m/s, 25 steps or more. Told are ratios within a "
        "quarter of -1 (hands), 180/pi and its inverse (degrees), 1000 and its inverse "
        "(millimetres). Where a third witness agrees with one of the two, the other is named.",
        "An IMU that hangs upside down turns the other way round: it is asked only where tf says "
        "how it hangs. Commands that were not followed leave their ratio to chance. Places that "
        "are mirrored while headings are not, and mirrored scans, are not seen.",
    ),
    "SR-ACT-001": Explanation(
        "An action the uncertainty did not allow",
        "Did 3 standard deviations of the position fit between the robot and the nearest obstacle?",
        "Published covariance projected onto the direction of the nearest obstacle along the "
        "action's path (first 1.5 m of its plan, else what it drove in 3 s; local costmap, else "
        "map) against the clearance from the footprint's edge.",
        "An over-confident covariance lets everything pass; the costmap's obstacles may be people.",
    ),
    "SR-ACT-002": Explanation(
        "An unplanned stop",
        "Did the robot stop before it had arrived?",
        "Odometry comes to rest, and a recovery follows, a safety device speaks up, the goal is "
        "aborted or still active, commands go on, or the plan's end is far.",
        "A goal that was cancelled on purpose looks the same: goals are not in the log's topics.",
    ),
    "SR-ACT-003": Explanation(
        "An incomplete or stale belief was acted on",
        "Did the belief that a motion or recovery was built on come with frame, time, covariance "
        "and map version, and was it fresh?",
        "For each action the localizer's last word that had arrived: its age against the limit "
        "(one that speaks on motion only is stale if the robot moved meanwhile), its covariance, "
        "and the map version on record.",
        "A log without the map topic or the pose topic lacks what the robot itself may have had.",
    ),
    "SR-ACT-004": Explanation(
        "The gate was passed on a false covariance",
        "Was an action allowed although the belief was really farther off than there was room?",
        "Belief against hindsight when the action began, against the clearance along its path.",
        "The clearance is taken where the robot believed to be; where it really was it may differ.",
    ),
    "SR-ACT-005": Explanation(
        "A needless recovery",
        "Did the robot recover although it was right about where it was and the map was right?",
        "Recorded recoveries begun in a healthy interval with the belief within half of the lost "
        "limit; those that are only inferred from motion do not count.",
        "Somebody may have stood in the way: people are no change of the map.",
    ),
    "SR-LAT-001": Explanation(
        "The pose was old when it was used",
        "How far did the robot move between the moment of its pose and the use of that pose?",
        "For each command of a controller, or plan, that came at a rate: its time minus the moment "
        "that tf could answer for by then, the older of odometry's last stamp that had arrived and "
        "the stamp of map -> odom. The motion in that time is odometry's; 0.2 m or 10 deg in one "
        "of 20 are worth a word, beyond the limits of being lost a warning where somebody planned.",
        "A message counts from when it was recorded; the robot had it a moment sooner or later. "
        "Where stamps and log times are of two clocks, real ages are longer. A controller that "
        "reads odometry alone is not late by what the localizer is.",
    ),
    "SR-LAT-002": Explanation(
        "A control loop stalled while the robot moved",
        "Did commands or plans that come at a rate fail to come while the robot moved on?",
        "The longest interval after a command that asked for motion, five periods and 0.25 s or "
        "longer, up to 2 s (20 periods); the motion in it is odometry's, judged as in SR-LAT-001.",
        "A recorder that dropped messages looks the same; so does a person who let go of a stick.",
    ),
    "SR-DAT-001": Explanation(
        "Parts of the replay bundle are missing",
        "Are odometry, IMU, scans, pose, covariance, map, costmap and recovery actions there?",
        "Roles that no topic could play.",
        "Hidden topics (actions) are recorded only on request: absence of a topic proves nothing.",
    ),
    "SR-DAT-002": Explanation(
        "Data was lost or mended while reading",
        "Was everything in the log readable?",
        "Counts by reason, from the manifest.",
        "Repairs are harmless more often than not; losses may hide the moment in question.",
    ),
    "SR-DAT-003": Explanation(
        "Placeholders instead of numbers",
        "Do covariances, rates and velocities say something, or do they only fill the message?",
        "All zero; one and the same although the robot moved 0.5 m; variances of 1e-9 and less "
        "or 1e5 and more; odometry as sure after 5 m and more as before; not positive; an IMU's "
        "-1; a sensor that is the same to the last bit. The tables keep them; estimators, "
        "hindsight and verdict find them not given.",
        "A covariance that is meant as a constant of the sensor (IMU, velocities) is none.",
    ),
    "SR-DAT-004": Explanation(
        "Numbers that are none",
        "Are velocities, rates and covariances finite?",
        "Rows with an infinity or not-a-number, by column. Poses without finite numbers are lost "
        "while reading (SR-DAT-002).",
        "Some drivers use them for what they do not measure.",
    ),
    "SR-DAT-005": Explanation(
        "A laser's numbers do not fit",
        "Do ranges change, and do angles and times fit the number of beams and the rate?",
        "Scans without any beam that says something, with one range in all beams, or the same to "
        "the last bit as the one before although the robot moved; angle_max, scan_time and "
        "time_increment against increments, beams and the period of the scans.",
        "A laser that sends every second scan takes half the period for a sweep; a simulator "
        "without noise repeats itself where nothing moves.",
    ),
}
