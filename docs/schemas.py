"""JSON Schemas of the files that a user writes, for editors; made from what the readers check with."""

import json
from collections.abc import Mapping
from typing import Any

from sms_handover.campaign.definition.fields import CAMPAIGN_FIELDS
from sms_handover.configuration.conditions_fields import CONDITIONS_FIELDS
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
from sms_handover.configuration.scenario_file import COMMON, DESCRIPTION, EXTENDS, KEYS, SHORT
from sms_handover.configuration.schedule_fields import DEPUTY_FIELDS, SCHEDULE_FIELDS
from sms_handover.configuration.values import CONDITIONS, DEPUTY, ROBOT, ROLES, SCHEDULE
from sms_handover.graph.topics import CONTROLLER, LOOP_NODES, NODES
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
        "conditions": schema_of(CONDITIONS_FIELDS),
        "parameters": _parameter_files(),
        "scenario": _scenario(),
        "campaign": schema_of(CAMPAIGN_FIELDS),
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


def _scenario() -> Schema:
    """Return the schema of scenario files."""
    file = {"type": "string"}
    definitions = {
        ROBOT: change_of(ROBOT_FIELDS),
        SCHEDULE: change_of(SCHEDULE_FIELDS),
        CONDITIONS: change_of(CONDITIONS_FIELDS),
    }
    for change in definitions.values():
        change["anyOf"][0]["properties"][EXTENDS] = {"description": "the file that is changed", **file}
    definitions[DEPUTY] = change_of(DEPUTY_FIELDS)
    named = {name: {"$ref": f"#/definitions/{name}"} for name in definitions}
    of_roles = {name: named[name] for name in (ROBOT, DEPUTY)}
    sections = {COMMON: COMMON_GROUP, **{node: OWN_GROUPS[node] for node in LOOP_NODES}}
    properties: Schema = {
        EXTENDS: {"description": "name of a shipped scenario, or path of a file", **file},
        DESCRIPTION: {"description": "what the scenario is, in one line", **file},
        ROBOT: {"anyOf": [file, named[ROBOT]]},
        SCHEDULE: {"anyOf": [file, named[SCHEDULE]]},
        DEPUTY: named[DEPUTY],
        CONDITIONS: {"anyOf": [file, named[CONDITIONS]]},
        **{name: schema_of(specs_of(sections[section].cls)[name]) for name, section in SHORT.items()},
        **{role: {"type": "object", "properties": of_roles, "additionalProperties": False} for role in ROLES},
        **{section: _object(specs_of(group.cls)) for section, group in sections.items()},
    }
    properties[CONTROLLER]["additionalProperties"] = True  # parameters of laws of other packages
    return {
        "description": "one run: what differs from another",
        "type": "object",
        "properties": {key: properties[key] for key in KEYS},
        "additionalProperties": False,
        "definitions": definitions,
    }


def change_of(spec: Spec) -> Schema:
    """Return what accepts every change that a scenario may make to a value: any part of it, null to remove.

    Named things are a list, or a mapping from name to change.
    """
    if isinstance(spec, ValueSpec):
        changes = [schema_of(spec)]
    elif isinstance(spec, EitherSpec):
        changes = [_value(spec.words), change_of(spec.other)]
    elif isinstance(spec, NamedSpec):
        changes = [{"type": "object", "additionalProperties": change_of(spec.each)}]
    elif isinstance(spec, ListSpec):
        each = change_of(spec.each)
        changes = [{"type": "array", "items": each}]
        if "name" in spec.each.required:
            changes.append({"type": "object", "additionalProperties": each})
    else:
        properties = {key: change_of(inner) for key, inner in spec.fields.items()}
        nothing_to_remove = {"type": "null"}
        changes = [{"type": "object", "properties": properties, "additionalProperties": nothing_to_remove}]
    description = spec.words.description if isinstance(spec, EitherSpec) else spec.description
    return {"description": description, "anyOf": [*changes, {"type": "null"}]}
