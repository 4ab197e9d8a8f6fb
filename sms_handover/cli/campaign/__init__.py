"""``sms-handover campaign``: run scenarios many times with drawn values, and look at what came of it."""

COMMANDS = {
    "run": "run a campaign, or go on with one",
    "status": "show how far a campaign is, what failed, which cases are worst",
    "rerun": "run one case again and compare it with its row",
    "merge": "merge the folders of shards into one",
}
DESCRIPTION = (
    "Run scenarios many times with drawn values under one law or several. 'sms-handover check FILE'\n"
    "checks a campaign file; 'compare' and 'report' take the folder of a campaign. See docs/campaigns.md."
)
