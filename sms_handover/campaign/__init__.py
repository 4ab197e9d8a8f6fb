"""Campaigns: many runs with drawn values, journalled case by case, and what came of them."""
