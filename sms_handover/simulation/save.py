"""Save the arrays of a run as a NumPy archive."""

from pathlib import Path
from typing import Any

import numpy as np

from sms_handover.errors import ConfigurationError
from sms_handover.run_data import RunData


def save_run(run: RunData, path: Path) -> None:
    """Write the arrays of a run to ``path`` (.npz); those per arm are named ``<field>.<arm>``.

    Raises ConfigurationError if the file exists or cannot be written.
    """
    arrays: dict[str, Any] = {
        name: value for name, value in vars(run).items() if isinstance(value, np.ndarray)
    }
    for name, per_arm in (("target_pose", run.target_pose), ("tool_pose", run.tool_pose)):
        arrays.update({f"{name}.{arm}": array for arm, array in per_arm.items()})
    arrays["joint_names"] = np.array(run.joint_names)
    try:
        with path.open("xb") as file:
            np.savez_compressed(file, **arrays)
    except FileExistsError:
        raise ConfigurationError(f"{path} exists; choose another file") from None
    except OSError as error:
        raise ConfigurationError(f"{path} cannot be written: {error.strerror}") from error
