"""The command ``sms-handover``: run, simulate, and look at what came out."""
