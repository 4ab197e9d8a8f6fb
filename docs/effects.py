"""Effects of conditions, each alone on the shipped task: writes a section of docs/conditions.md."""

import os
from collections.abc import Iterable, Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from math import inf, isnan, nan
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("svg")  # draws into a file; needs no display

import matplotlib.pyplot as plt
import numpy as np

from docs.tables import table
from sms_handover.analysis.signals import base_rotation
from sms_handover.errors import NoPlanError
from sms_handover.simulation.scenario import load_scenario
from sms_handover.simulation.simulate import simulate
from sms_handover.units import DEG_PER_RAD, MM_PER_M

PAGE = Path(__file__).resolve().parent / "conditions.md"
PICTURE = PAGE.parent / "images" / "effects.svg"
COLOURS = {"nmpc": "#0072b2", "pid": "#d55e00", "mpc": "#009e73"}
LAWS = tuple(COLOURS)
TICK = 0.004  # [s], four times the shipped one, to save time: noise has the same density
ROTOR = 0.31  # [kg m^2], that of the shipped conditions
_OPEN = {  # tolerances at which every grasp holds, so that every effect is followed to the end
    "plant.grasp_position_tolerance": 10.0,
    "plant.grasp_angle_tolerance": 3.2,
    "plant.grasp_speed_tolerance": 100.0,
    "plant.grasp_rate_tolerance": 1000.0,
}
_SEED = 1
_HEAD, _NEXT = "## What matters\n", "## "
MS_PER_S = 1000.0  # [ms/s]
_LEO = {"radius": 6.778e6, "radial": [1, 0, 0], "normal": [0, 0, 1]}
_GEO = {"radius": 4.2164e7, "radial": [1, 0, 0], "normal": [0, 0, 1]}
_MISFIRE = {"force": [1, 0, 0], "point": [0, 0.5, 0], "start": 10.0, "duration": 0.05}
_PRESSURE = {"force": [-2.7e-5, 0, 0], "torque": [0, 0, 0], "point": [0, 0.01, 0]}
_DRAG = {"force": [0, -6.6e-4, 0], "torque": [0, 0, 0], "point": [0.1, 0, 0]}
_ENCODERS = {"step": 2.4e-5, "bandwidth": 100.0}
_GYRO = {"noise_density": 2.9e-5, "bias": [2.8e-6, 2.8e-6, 2.8e-6]}
_STAR_TRACKER = {"noise": 1.2e-4, "period": 0.1, "latency": 0.1}
_VISION = {"position_noise": 0.002, "angle_noise": 0.0087, "period": 0.1, "latency": 0.1, "dropped": 0.01}
_POOR_VISION = {
    **{"position_noise": 0.005, "angle_noise": 0.0175, "position_bias": [0.0, 0.002, 0.0]},
    **{"period": 0.1, "latency": 0.2, "dropped": 0.1},
}


def _friction(share: float) -> dict[str, Any]:
    """Return a share of the friction of the Gen3."""
    dry, held = share * 2.5, share * 3.0
    return {"friction": {"viscous": share * 2.0, "coulomb": dry, "stiction": held, "stribeck_speed": 0.01}}


EFFECTS: Mapping[str, dict[str, Any]] = {
    "rotors alone": {},
    "friction, 10 % of the Gen3's": _friction(0.1),
    "friction, 1 %": _friction(0.01),
    "friction, 0.1 %": _friction(0.001),
    "torque gain 5 %": {"torque": {"gain": 0.05}},
    "torque offset 0.05 N m": {"torque": {"offset": 0.05}},
    "torque step 0.05 N m": {"torque": {"step": 0.05}},
    "torque noise 3.2e-3 N m/sqrt(Hz)": {"torque": {"noise_density": 0.0032}},
    "command delay 20 ms": {"command": {"delay": 0.02}},
    "command delay 200 ms": {"command": {"delay": 0.2}},
    "1 % of commands lost": {"command": {"dropped": 0.01}},
    "thruster misfire 1 N x 50 ms": {"wrenches": {"misfire": {"thruster_misfire": _MISFIRE}}},
    "gravity gradient, 400 km": {"wrenches": {"gravity": {"gravity_gradient": _LEO}}},
    "gravity gradient, GEO": {"wrenches": {"gravity": {"gravity_gradient": _GEO}}},
    "1 m from the orbit, 400 km": {
        "wrenches": {"hill": {"relative_orbit": {**_LEO, "reference": [-1, 0, 0]}}}
    },
    "solar pressure, GEO": {"wrenches": {"pressure": {"constant": _PRESSURE}}},
    "drag, 400 km": {"wrenches": {"drag": {"constant": _DRAG}}},
    "base: mass 5 %, 10 mm, inertia 10 %": {
        "model_error": {"base": {"mass": 0.05, "com": 0.01, "inertia": 0.1}}
    },
    "links: mass 2 %, 5 mm, inertia 10 %": {
        "model_error": {"links": {"mass": 0.02, "com": 0.005, "inertia": 0.1}}
    },
    "encoders: 18 bit, rates within 100 1/s": {"sensors": {"encoders": _ENCODERS}},
    "encoders: zeros off by 0.5 mrad": {"sensors": {"encoders": {"offset": 5e-4, "bandwidth": 100.0}}},
    "gyro: 0.1 deg/sqrt(h), 1 deg/h": {"sensors": {"gyro": _GYRO}},
    "star tracker: 25 arcsec, 10 Hz, 0.1 s late": {"sensors": {"star_tracker": _STAR_TRACKER}},
    "vision: 2 mm/m, 0.5 deg/m, 10 Hz, 0.1 s late": {"sensors": {"vision": _VISION}},
    "vision: 5 mm/m, 1 deg/m, 2 mm off, 0.2 s late": {"sensors": {"vision": _POOR_VISION}},
    "all sensors of 'nominal'": {
        "sensors": {
            "encoders": {**_ENCODERS, "offset": 1e-4},
            **{"gyro": _GYRO, "star_tracker": _STAR_TRACKER, "vision": _VISION},
        }
    },
    "mounts: 1 mm, 2 mrad": {"model_error": {"mounts": {"position": 0.001, "angle": 0.002}}},
    "panels that swing, 2 x 5 kg at 0.5 Hz": {},
}
SCENARIOS = {"panels that swing, 2 x 5 kg at 0.5 Hz": "panels"}  # of effects that are no conditions


@dataclass(frozen=True)
class Effect:
    """What came of the task: errors of grasp and transfer in mm and degrees, turn of the base in degrees."""

    distances: tuple[float, ...]
    angles: tuple[float, ...]
    turn: float

    @property
    def holds(self) -> bool:
        """Whether both grasps would have held with the shipped tolerances."""
        parameters = load_scenario("smooth").parameters.plant
        far, askew = parameters.grasp_position_tolerance, parameters.grasp_angle_tolerance
        return self.farther <= far * MM_PER_M and max(self.angles) <= askew * DEG_PER_RAD

    @property
    def farther(self) -> float:
        """The larger distance of both grasps, infinite without a grasp."""
        distance = max(self.distances)
        return inf if isnan(distance) else distance


def effect_of(name: str, law: str) -> Effect:
    """Return what comes of the smooth handover under a law and an effect, with rotors in any case."""
    conditions, scenario = EFFECTS[name], SCENARIOS.get(name, "smooth")
    values: dict[str, Any] = {"conditions.rotor_inertia": ROTOR, "law": law, "seed": _SEED, **_OPEN}
    values |= {f"conditions.{name}": value for name, value in conditions.items()}
    if "sensors" in conditions:
        values["source"] = "measured"
    try:
        run = simulate(load_scenario(scenario, {"common.tick": TICK, **values}))
    except NoPlanError:
        return Effect((nan,), (nan,), nan)
    events = run.grasp_events
    return Effect(
        tuple(event.position_error * MM_PER_M for event in events) or (nan,),
        tuple(event.angle_error * DEG_PER_RAD for event in events) or (nan,),
        float(np.nanmax(np.linalg.norm(base_rotation(run).values, axis=1))) * DEG_PER_RAD,
    )


def section(found: Mapping[str, Mapping[str, Effect]]) -> str:
    """Return the text of the section with the effects by name and law."""
    head = ("Effect alone", *(f"{law}: grasp, transfer [mm]; angle [deg]; base [deg]" for law in LAWS))
    rows = [(name, *(_cell(of_law[law]) for law in LAWS)) for name, of_law in _ranked(found)]
    return f"""\
This section is written by `make effects`. The smooth handover with rotors of {ROTOR:g} kg m^2, a tick of
{TICK * MS_PER_S:g} ms, seed {_SEED}, and one effect alone. Distances are those of tool and grasp frame at the
grasp and at the transfer, the angle is the larger one of both, the base its largest turn. Tolerances are
opened, so that each effect is followed to the end, and the loop goes by sensors where there are any;
**bold** is where a grasp would have missed (10 mm, 2 degrees). Sorted by the larger distance under the
best law. `mpc` has no observer here: [control](control.md) tells what one gains.

![The effects, ranked](images/effects.svg)

{table(head, rows)}
"""


def with_section(page: str, text: str) -> str:
    """Return a page with another text in the section that is written here."""
    begin = page.index(_HEAD) + len(_HEAD)
    return f"{page[:begin]}\n{text}\n{page[page.index(_NEXT, begin) :]}"


def _cell(effect: Effect) -> str:
    """Return an effect as text, bold where a grasp would miss."""
    if isnan(effect.turn):
        return "**no plan**"
    distances = ", ".join(f"{mm:.2f}" for mm in effect.distances)
    text = f"{distances}; {max(effect.angles):.2f}; {effect.turn:.2f}"
    return text if effect.holds else f"**{text}**"


def _ranked(found: Mapping[str, Mapping[str, Effect]]) -> list[tuple[str, Mapping[str, Effect]]]:
    """Return effects, the one that costs most first, by the larger distance under the better law."""
    return sorted(found.items(), key=lambda item: -min(one.farther for one in item[1].values()))


def draw(found: Mapping[str, Mapping[str, Effect]], file: Path) -> None:
    """Draw the effects, ranked, beside the tolerance of a grasp."""
    matplotlib.rcParams.update({"svg.hashsalt": "sms_handover", "svg.fonttype": "none"})
    ranked = _ranked(found)[::-1]
    figure, axes = plt.subplots(figsize=(7.5, 0.42 * len(ranked) + 1.0), layout="constrained")
    for index, law in enumerate(LAWS):
        widths = [max(of_law[law].distances) for _, of_law in ranked]
        places = np.arange(len(ranked)) + 0.27 * (1 - index)
        axes.barh(places, widths, 0.25, label=law, color=COLOURS[law])
    axes.axvline(10.0, color="black", linewidth=1.0, linestyle="--", label="tolerance of a grasp")
    axes.set_yticks(range(len(ranked)), [name for name, _ in ranked])
    axes.set_xscale("log")
    axes.set_xlabel("larger distance of tool and grasp frame, of grasp and transfer [mm]")
    axes.legend(loc="lower right")
    figure.savefig(file, metadata={"Date": None})
    plt.close(figure)


def measured(names: Iterable[str]) -> dict[str, dict[str, Effect]]:
    """Run the task under the effects of these names."""
    found: dict[str, dict[str, Effect]] = {}
    runs = [(name, law) for name in names for law in LAWS]
    with ProcessPoolExecutor(os.cpu_count()) as pool:
        for (name, law), effect in zip(runs, pool.map(effect_of, *zip(*runs, strict=True)), strict=True):
            found.setdefault(name, {})[law] = effect
            print(name, law, _cell(effect), sep=" | ", flush=True)
    return found


def main() -> None:
    """Run the task under every effect and write page and picture."""
    found = measured(EFFECTS)
    draw(found, PICTURE)
    PAGE.write_text(with_section(PAGE.read_text(encoding="utf-8"), section(found)), encoding="utf-8")
    print(f"{PAGE.name} written")


if __name__ == "__main__":
    main()
