"""Regression models of the robot and of the simulator; they are fitted with torch and act with numpy."""
