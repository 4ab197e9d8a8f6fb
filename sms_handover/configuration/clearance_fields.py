"""Fields of the section ``clearance`` of a robot file: solids of links, and which pairs may touch."""

from sms_handover.configuration.field_specification import (
    ListSpec,
    MappingSpec,
    NamedSpec,
    Spec,
    ValueSpec,
    text,
    vector,
)

_RADIUS = ValueSpec("radius", "m", above=0.0)
_LENGTH = ValueSpec("length along z, of a capsule between the centres of its ends", "m", above=0.0)


def clearance_fields(origin: MappingSpec) -> MappingSpec:
    """Return the specification of the section, with that of the pose of a shape in its link."""
    long = {"radius": _RADIUS, "length": _LENGTH}
    mesh = MappingSpec(
        "the convex hull of a mesh",
        {"file": text("path or URI of the mesh")},
        {"scale": vector(3, "factors along x, y, z", above=0.0)},
    )
    kinds: dict[str, Spec] = {
        "box": vector(3, "edges of a box along x, y, z", "m", above=0.0),
        "cylinder": MappingSpec("a cylinder along z", long),
        "capsule": MappingSpec("a cylinder along z with a half sphere at each end", long),
        "sphere": MappingSpec("a sphere", {"radius": _RADIUS}),
        "mesh": mesh,
    }
    shape = MappingSpec("one solid", optional={**kinds, "origin": origin}, one_of=tuple(kinds))
    pairs = "pairs of links, each a list of two names, "
    return MappingSpec(
        "what can touch what",
        optional={
            "shapes": NamedSpec("solids by link, in place of what is drawn", ListSpec("solids", shape)),
            "allow": ValueSpec(f"{pairs}that may touch", kind=object),
            "count": ValueSpec(f"{pairs}that may not, though they are neighbours", kind=object),
        },
    )
