"""A custom torque law for sms_handover."""
