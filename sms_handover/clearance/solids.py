"""Solids of a robot description as Pinocchio's geometry: primitives, and convex hulls of meshes."""

import os
from pathlib import Path
from urllib.parse import unquote, urlsplit
from xml.etree import ElementTree as ET

import coal
import pinocchio as pin

from sms_handover.errors import RobotDescriptionError
from sms_handover.model.shape_elements import read_replaced

_HULL = "Qt"  # qhull: faces with more than three corners are cut into triangles


class MissingMeshError(RobotDescriptionError):
    """The file of a mesh is not where the description says."""


def require_meshes(urdf: str) -> None:
    """Raise MissingMeshError unless the file of every solid mesh is there."""
    try:
        meshes = ET.fromstring(urdf).iterfind("link/collision/geometry/mesh")
    except ET.ParseError as error:
        raise RobotDescriptionError(f"the robot description cannot be read: {error}") from error
    for mesh in meshes:
        _require(mesh.get("filename", ""))


def read_solids(model: pin.Model, urdf: str) -> pin.GeometryModel:
    """Return the solids of a description as Pinocchio's geometry, without pairs.

    ``model`` is Pinocchio's reading of the same text. A solid is what has a collision element; of a mesh it
    is the convex hull. What is drawn besides is solid too if all that is solid of its link is drawn, or
    nothing is: a description that draws its solids draws all of them, as the first edition's does with its
    solar panels. Meshes that are drawn are not. Raises RobotDescriptionError if the shapes cannot be read,
    MissingMeshError where a file is missing.
    """
    require_meshes(urdf)
    try:
        root = ET.fromstring(urdf)
        folders = [str(folder) for folder in package_folders()]
        solids = pin.buildGeomFromUrdfString(model, urdf, pin.GeometryType.COLLISION, package_dirs=folders)
        drawn = pin.buildGeomFromUrdfString(model, _without_drawn_meshes(root), pin.GeometryType.VISUAL)
    except (ValueError, RuntimeError) as error:
        raise RobotDescriptionError(f"the shapes of the robot cannot be read: {_one_line(error)}") from error
    replaced = read_replaced(urdf)
    given = list(solids.geometryObjects)
    for item in drawn.geometryObjects:
        link = item.parentFrame
        of_link = [solid for solid in given if solid.parentFrame == link]
        shown = [other for other in drawn.geometryObjects if other.parentFrame == link]
        if model.frames[link].name in replaced or any(_same(item, solid) for solid in of_link):
            continue
        if all(any(_same(solid, other) for other in shown) for solid in of_link):
            solids.addGeometryObject(item)
    for item in solids.geometryObjects:
        if isinstance(item.geometry, coal.BVHModelBase):
            item.geometry = _hull(item)
    return solids


def package_folders() -> tuple[Path, ...]:
    """Return the folders in which ``package://`` names are looked up: those of ROS workspaces."""
    prefixes = [prefix for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if prefix]
    paths = [path for path in os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep) if path]
    return (*(Path(prefix) / "share" for prefix in prefixes), *map(Path, paths))


def _require(uri: str) -> None:
    """Raise MissingMeshError unless the file of a mesh is there."""
    try:
        parts = urlsplit(uri)
    except ValueError as error:
        raise MissingMeshError(f"there is no mesh file {uri!r}: {error}") from error
    name = unquote(f"{parts.netloc}{parts.path}")
    if parts.scheme == "package":
        folders = package_folders()
        places = [folder / name for folder in folders]
        where = f" in {', '.join(map(str, folders))}" if folders else ": no ROS workspace is sourced"
    else:
        places, where = [Path(unquote(parts.path))], ""
    if not any(place.is_file() for place in places):
        raise MissingMeshError(f"there is no mesh file {uri}{where}")


def _without_drawn_meshes(root: ET.Element) -> str:
    """Return a description whose visual elements are primitives; changes the element."""
    for link in root.iter("link"):
        for visual in link.findall("visual"):
            if visual.find("geometry/mesh") is not None:
                link.remove(visual)
    return ET.tostring(root, encoding="unicode")


def _hull(item: pin.GeometryObject) -> coal.ConvexBase:
    """Return the convex hull of a mesh; raises RobotDescriptionError if it has none."""
    mesh = item.geometry
    try:
        mesh.buildConvexHull(True, _HULL)
    except RuntimeError as error:
        raise RobotDescriptionError(f"{item.meshPath} has no convex hull: {_one_line(error)}") from error
    return mesh.convex


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())


def _same(one: pin.GeometryObject, other: pin.GeometryObject) -> bool:
    """Whether two geometry objects are the same solid at the same place."""
    if type(one.geometry) is not type(other.geometry):
        return False
    return bool(one.placement.isApprox(other.placement) and one.geometry == other.geometry)
