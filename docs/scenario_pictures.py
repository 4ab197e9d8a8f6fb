"""Pictures of the shipped scenarios: snapshots of a run in one process, for docs/scenarios.md."""

from argparse import ArgumentParser
from pathlib import Path

from PIL import Image

from sms_handover.analysis.figures.draw import draw_figures, write_figure
from sms_handover.analysis.figures.drawn_run import DrawnRun
from sms_handover.configuration.scenario_file import scenario_names
from sms_handover.scene.scene import make_scene
from sms_handover.simulation.scenario import load_scenario
from sms_handover.simulation.simulate import simulate

FOLDER = Path(__file__).resolve().parent / "images"
LARGEST = 150  # [kB] of a picture
_DPI = 110  # [1/in]
_COLOURS = 256  # of a picture, which keeps it small
_FRAME_RATE = 10.0  # [1/s] of the scene that snapshots are taken from


def picture_of(name: str) -> Path:
    """Return the file of the picture of a scenario."""
    return FOLDER / f"scenario_{name}.png"


def draw(name: str) -> None:
    """Run a scenario and write its picture; raises SystemExit if that takes too much room."""
    scenario = load_scenario(name)
    run, world = simulate(scenario), scenario.truth
    scene = make_scene(run, world.robot.urdf, world.schedule.deputy.size, _FRAME_RATE)
    ((_, figure),) = draw_figures([DrawnRun(name, run, scene)], ["snapshots"])
    file = picture_of(name)
    write_figure(figure, file, _DPI)
    with Image.open(file) as drawn:
        small = drawn.convert("RGB").quantize(_COLOURS, Image.Quantize.MAXCOVERAGE)
    small.save(file, optimize=True)
    size = file.stat().st_size / 1000
    print(f"{file}: {size:.0f} kB")
    if size > LARGEST:
        raise SystemExit(f"{file} has {size:.0f} kB, allowed are {LARGEST} kB")


def main() -> None:
    """Write the pictures of the scenarios given by name, by default of all that are shipped."""
    parser = ArgumentParser(description=main.__doc__)
    parser.add_argument("names", nargs="*", metavar="SCENARIO")
    for name in parser.parse_args().names or scenario_names():
        draw(name)


if __name__ == "__main__":
    main()
