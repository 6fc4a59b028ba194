"""The layout for Foxglove and Lichtblick asks only for what the file holds and viewers know.

Names of settings: Lichtblick's sources, packages/suite-base/src: context/CurrentLayoutContext
(LayoutData), panels/ThreeDeeRender/IRenderer.ts (RendererConfig) with renderables/colorMode.ts,
pointExtensionUtils.ts, Poses.ts and settings.ts, panels/Plot/utils/config.ts (PlotConfig),
panels/StateTransitions/types.ts, panels/Log/types.ts, panels/RawMessages. Foxglove was forked from
the same sources; what it alone knows stands in python/foxglove-sdk of foxglove/foxglove-sdk.
"""

import json
import re
from dataclasses import replace

import pytest
from exported import exported
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

from slamreplay.evidence import colours
from slamreplay.export.foxglove import write_foxglove
from slamreplay.report.figures import canvas
from slamreplay.verdict.judgement import STATES

TITLE = {"foxglovePanelTitle", "lichtblickPanelTitle"}
CAMERA = {
    "perspective", "distance", "phi", "thetaOffset", "targetOffset", "target",
    "targetOrientation", "fovy", "near", "far",
}  # fmt: skip
SETTINGS = {
    "3D": {
        "cameraState", "followMode", "followTf", "scene", "transforms", "topics", "layers",
        "publish", "imageMode",
    },
    "Plot": {
        "paths", "minXValue", "maxXValue", "minYValue", "maxYValue", "showLegend", "legendDisplay",
        "showPlotValuesInLegend", "showXAxisLabels", "showYAxisLabels", "isSynced", "xAxisVal",
        "xAxisPath", "followingViewWidth", "sidebarDimension",
    },
    "StateTransitions": {"isSynced", "paths", "xAxisMaxValue", "xAxisMinValue", "xAxisRange"},
    "RosOut": {"searchTerms", "minLogLevel", "topicToRender", "nameFilter"},
    "RawMessages": {
        "topicPath", "diffTopicPath", "diffMethod", "diffEnabled", "showFullMessageForDiff",
        "expansion",
    },
}  # fmt: skip
OF_TOPIC = {
    "foxglove.Grid": {"visible", "frameLocked", "colorMode", "colorField", "explicitAlpha"},
    "foxglove.PointCloud": {
        "visible", "colorMode", "colorField", "flatColor", "pointSize", "pointShape", "decayTime",
    },
    "foxglove.PoseInFrame": {"visible", "type", "color", "arrowScale", "axisScale"},
    "foxglove.SceneUpdate": {"visible", "showOutlines", "color", "selectedIdVariable"},
}  # fmt: skip
COLOUR_MODES = {"flat", "gradient", "colormap", "rgb", "rgba", "rgba-fields"}
PATH_SETTINGS = {
    "value", "enabled", "color", "label", "timestampMethod", "showLine", "lineSize",
    "customStates",  # of Foxglove alone
}  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    bundle, post, runs = exported()
    folder = tmp_path_factory.mktemp("layout")
    write_foxglove(post, bundle.view(), folder, runs=runs)
    return folder


@pytest.fixture(scope="module")
def layout(folder):
    return json.loads((folder / "layout.json").read_text())


@pytest.fixture(scope="module")
def messages(folder):
    """Topic to its schema's name and its first message."""
    with (folder / "slamreplay.mcap").open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        found = {}
        for schema, channel, _, content in reader.iter_decoded_messages():
            found.setdefault(channel.topic, (schema.name, content))
    return found


def leaves(tree) -> list[str]:
    """Panels of a tree of splits, as react-mosaic's MosaicNode has it."""
    if isinstance(tree, str):
        return [tree]
    assert set(tree) == {"first", "second", "direction", "splitPercentage"}
    assert tree["direction"] in ("row", "column")
    assert 0.0 < tree["splitPercentage"] < 100.0
    return leaves(tree["first"]) + leaves(tree["second"])


def test_it_has_the_form_of_an_exported_layout(layout):
    assert set(layout) == {"configById", "globalVariables", "userNodes", "playbackConfig", "layout"}
    assert layout["playbackConfig"] == {"speed": 1}
    shown = leaves(layout["layout"])
    assert sorted(shown) == sorted(layout["configById"])
    assert len(shown) == len(set(shown))
    kinds = [re.fullmatch(r"(\w+)!\w+", name)[1] for name in shown]
    assert set(kinds) == set(SETTINGS)


def test_every_setting_is_one_that_the_panel_has(layout):
    for name, config in layout["configById"].items():
        assert set(config) - TITLE <= SETTINGS[name.partition("!")[0]], name


def test_the_scene_shows_what_is_in_the_file(layout, messages):
    scene = layout["configById"]["3D!slamreplay"]
    drawable = {t for t, (schema, _) in messages.items() if schema in OF_TOPIC}

    assert set(scene["cameraState"]) == CAMERA
    assert scene["followMode"] in ("follow-pose", "follow-position", "follow-none")
    assert set(scene["topics"]) == drawable
    for topic, config in scene["topics"].items():
        schema, message = messages[topic]
        assert set(config) <= OF_TOPIC[schema], topic
        assert config.get("colorMode", "flat") in COLOUR_MODES
        if config.get("colorMode") == "rgba-fields":
            fields = {field.name for field in message.fields}
            assert {"red", "green", "blue", "alpha", config["colorField"]} <= fields
    hidden = {t for t, config in scene["topics"].items() if not config["visible"]}
    # Another frame's path would be in error, and arrows of each run would hide the robots.
    runs = {f"/slamreplay/runs/{n}" for n in ("amcl/pose", "dead_reckoning/pose")}
    assert hidden == runs | {"/slamreplay/runs/dead_reckoning/path"}


def test_frames_of_the_scene_are_in_the_file(layout, messages):
    scene = layout["configById"]["3D!slamreplay"]
    (step,) = messages["/slamreplay/transforms"][1].transforms
    frames = {name.removeprefix("frame:") for name in scene["transforms"]}

    assert scene["followTf"] == step.parent_frame_id
    assert frames == {"map", "base_believed", "base_hindsight"}


def test_every_path_leads_to_a_field(layout, messages):
    paths = [
        (name.partition("!")[0], path)
        for name, config in layout["configById"].items()
        for path in config.get("paths", [])
    ]
    led = set()
    for kind, path in paths:
        assert set(path) <= PATH_SETTINGS
        assert path["timestampMethod"] == "receiveTime"
        if re.fullmatch(r"[\d.]+", path["value"]):  # isReferenceLinePlotPathType
            assert kind == "Plot"
            continue
        topic, _, field = path["value"].rpartition(".")
        value = getattr(messages[topic][1], field)
        assert isinstance(value, str if kind == "StateTransitions" else float)
        led.add(path["value"])
    assert led == {
        "/slamreplay/error_m.value",
        "/slamreplay/nees.value",
        "/slamreplay/state.state",
    }
    panels = layout["configById"]
    assert panels["RosOut!slamreplay"]["topicToRender"] in messages
    assert panels["RawMessages!slamreplay"]["topicPath"] in messages


def test_states_have_the_colours_of_the_report(layout):
    (path,) = layout["configById"]["StateTransitions!slamreplay"]["paths"]
    shown = {s["value"]: s["color"].lower() for s in path["customStates"]["states"]}

    assert shown == {state: canvas.STATE_COLOURS[state].lower() for state in STATES}
    assert set(colours.STATES) == set(STATES)


def test_a_log_without_poses_has_a_layout_too(tmp_path):
    bundle, post, _ = exported()
    bare = replace(post, belief=None, hindsight=None, grid=None, scene=None)
    write_foxglove(bare, bundle.view(), tmp_path)
    layout = json.loads((tmp_path / "layout.json").read_text())

    assert sorted(leaves(layout["layout"])) == sorted(layout["configById"])
    assert not [name for name in layout["configById"] if name.startswith("Plot")]
