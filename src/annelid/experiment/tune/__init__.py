"""Tuning a gait: fields of controller and body in ranges, runs judged by speed, cost of transport or slip."""
