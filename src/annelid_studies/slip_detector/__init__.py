"""A slip detector of stretch and load, and how well it knows what the simulator knows."""

from annelid_studies.slip_detector.detector import SlipDetector
from annelid_studies.slip_detector.scores import (
    Detection,
    DetectionScore,
    detect_slip,
    precision_recall,
    score_detections,
)

__all__ = ["Detection", "DetectionScore", "SlipDetector", "detect_slip", "precision_recall", "score_detections"]
