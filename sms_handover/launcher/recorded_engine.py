"""A second engine on a recorded run: its verdict, from the bag alone."""

import tempfile
from pathlib import Path

from sms_handover.bag.info import read_info
from sms_handover.bag.run.reader import read_run
from sms_handover.engines.protocol import Engine
from sms_handover.engines.verdict import Verdict, verdict_of
from sms_handover.errors import BagError, ConfigurationError
from sms_handover.graph.topics import PLANT
from sms_handover.launcher.recorded_scenario import scenario_in


def recorded_verdict(engine: Engine, bag: Path) -> Verdict:
    """Return what an engine says of the run in a bag.

    Raises ConfigurationError if the bag is damaged, does not say what it was made with, or lacks states.
    """
    with tempfile.TemporaryDirectory() as folder:
        try:
            info = read_info(bag)
            scenario = scenario_in(info, Path(folder))
            name = str(info.parameters[PLANT].get("scenario", ""))
            return verdict_of(engine, read_run(bag), scenario, name)
        except BagError as error:
            raise ConfigurationError(str(error)) from error
