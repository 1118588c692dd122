"""The authors' later robot, on their own axes and by their own definitions: Riddle et al. 2025, and their scripts."""
