"""The command line (cli) ``sms-handover``: run, simulate, and analyse the results."""
