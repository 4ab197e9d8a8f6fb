"""JSON Schemas of the files that a user writes, for editors; made from what the readers check with."""

import json
from collections.abc import Mapping
from typing import Any

from sms_handover.configuration.field_specification import (
    FLOATS,
    TEXTS,
    EitherSpec,
    ListSpec,
    NamedSpec,
    Spec,
    ValueSpec,
)
from sms_handover.configuration.parameters import EVERY_NODE, specs_of
from sms_handover.configuration.robot_fields import ARM_FIELDS, ROBOT_FIELDS
from sms_handover.configuration.schedule_fields import SCHEDULE_FIELDS
from sms_handover.graph.topics import CONTROLLER, NODES
from sms_handover.ros.reference.interfaces import COMMON_GROUP, OWN_GROUPS

Schema = dict[str, Any]

_DRAFT = "http://json-schema.org/draft-07/schema#"  # which every editor knows
_TYPES = {float: "number", int: "integer", bool: "boolean", str: "string"}
_OF_ROS = "^(use_sim_time|start_type_description_service|qos_overrides\\..*)$"  # parameters of any node
_PARAMETERS = "ros__parameters"


def schemas() -> dict[str, str]:
    """Return the text of each schema, by the name of its file."""
    found = {
        "robot": schema_of(ROBOT_FIELDS),
        "arm": schema_of(ARM_FIELDS),
        "schedule": schema_of(SCHEDULE_FIELDS),
        "parameters": _parameter_files(),
    }
    return {
        f"{name}.schema.json": json.dumps({"$schema": _DRAFT, **schema}, indent=1) + "\n"
        for name, schema in found.items()
    }


def schema_of(spec: Spec) -> Schema:
    """Return what accepts at least every value that a specification allows."""
    if isinstance(spec, ValueSpec):
        unit = f" [{spec.unit}]" if spec.unit else ""
        return {"description": spec.description + unit, **_value(spec)}
    if isinstance(spec, EitherSpec):
        return {"description": spec.words.description, "anyOf": [_value(spec.words), schema_of(spec.other)]}
    schema: Schema = {"description": spec.description}
    if isinstance(spec, ListSpec):
        return {**schema, "type": "array", "items": schema_of(spec.each), "minItems": spec.shortest}
    if isinstance(spec, NamedSpec):
        return {**schema, "type": "object", "additionalProperties": schema_of(spec.each)}
    if spec.one_of:
        schema["oneOf"] = [{"required": [key]} for key in spec.one_of]
    return {**schema, **_object(spec.fields), "required": list(spec.required)}


def _object(fields: Mapping[str, Spec]) -> Schema:
    """Return the schema of a mapping with known keys."""
    properties = {key: schema_of(inner) for key, inner in fields.items()}
    return {"type": "object", "properties": properties, "additionalProperties": False}


def _value(spec: ValueSpec) -> Schema:
    """Return the schema of one value."""
    bounds = {"minimum": spec.minimum, "maximum": spec.maximum, "exclusiveMinimum": spec.above}
    schema: Schema = {key: bound for key, bound in bounds.items() if bound is not None}
    if spec.choices:
        schema["enum"] = list(spec.choices)
    if spec.kind in (FLOATS, TEXTS):
        schema = {"type": "array", "items": {"type": "number" if spec.kind == FLOATS else "string", **schema}}
        return schema if spec.size is None else {**schema, "minItems": spec.size, "maxItems": spec.size}
    return {"type": _TYPES[spec.kind], **schema} if spec.kind in _TYPES else schema


def _parameter_files() -> Schema:
    """Return the schema of ROS parameter files, which may have sections of other nodes too.

    A node takes the parameters that all nodes share in its own section too, the controller those of laws
    of other packages.
    """
    shared = specs_of(COMMON_GROUP.cls)
    sections = {EVERY_NODE: _section(shared)}
    for node, group in OWN_GROUPS.items():
        own: dict[str, ValueSpec] = specs_of(group.cls)
        sections[node] = _section({**own, **shared} if node in NODES else own)
    sections[CONTROLLER]["properties"][_PARAMETERS]["additionalProperties"] = True
    return {"description": "parameters in ROS 2 form", "type": "object", "properties": sections}


def _section(parameters: Mapping[str, Spec]) -> Schema:
    """Return the schema of the section of a node."""
    inner = {**_object(parameters), "patternProperties": {_OF_ROS: {}}}
    return {"type": "object", "properties": {_PARAMETERS: inner}, "required": [_PARAMETERS]}
