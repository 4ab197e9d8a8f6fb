"""Solar panels of a spacecraft: drawn on it, or on hinges with a spring and a damper."""

from dataclasses import dataclass

from sms_handover.model.parts import Floats, Inertia, box_moments
from sms_handover.model.validation import check_unit_axis, number, vector


@dataclass(frozen=True)
class Hinge:
    """A passive joint at ``xyz`` (3,) m about a unit ``axis`` (3,), both in ``base_link``.

    With the angle q it gives the torque -k q - c q', with ``stiffness`` k N m/rad and ``damping`` c
    N m s/rad: the first bending of a panel, or of the yoke that carries it.
    """

    xyz: Floats
    axis: Floats
    stiffness: float
    damping: float

    def __post_init__(self) -> None:
        vector(self.xyz, 3, "hinge xyz", "m")
        vector(self.axis, 3, "hinge axis")
        check_unit_axis(self.axis, "hinge axis")
        number(self.stiffness, "hinge stiffness", "N m/rad", above=0.0)
        number(self.damping, "hinge damping", "N m s/rad", minimum=0.0)


@dataclass(frozen=True)
class Panel:
    """A box with its centre at ``xyz`` (3,) m in ``base_link`` and edges ``size`` (3,) m.

    Without a ``hinge`` it is drawn, and has no ``mass`` kg; with one it is uniform.
    """

    xyz: Floats
    size: Floats
    mass: float = 0.0
    hinge: Hinge | None = None

    def __post_init__(self) -> None:
        vector(self.xyz, 3, "panel xyz", "m")
        vector(self.size, 3, "panel size", "m", above=0.0)
        if self.hinge:
            number(self.mass, "panel mass", "kg", above=0.0)


@dataclass(frozen=True)
class FlexiblePanel:
    """A panel on a hinge, by the names of its link and joint; the frame of the link is at the hinge."""

    link: str
    joint: str
    panel: Panel
    hinge: Hinge

    @property
    def centre(self) -> Floats:
        """Its centre (3,) m in the frame of its link."""
        return tuple(c - h for c, h in zip(self.panel.xyz, self.hinge.xyz, strict=True))

    @property
    def inertia(self) -> Inertia:
        """Its inertia in the frame of its link."""
        panel = self.panel
        return Inertia(self.link, panel.mass, self.centre, box_moments(panel.mass, panel.size))


def flexible_panels(panels: tuple[Panel, ...]) -> tuple[FlexiblePanel, ...]:
    """Return those of some panels that have a hinge, numbered from 1 among all."""
    return tuple(
        FlexiblePanel(f"panel_{number_from_1}", f"panel_{number_from_1}_hinge", panel, panel.hinge)
        for number_from_1, panel in enumerate(panels, start=1)
        if panel.hinge
    )
