"""A torque law of one's own for sms_handover."""
