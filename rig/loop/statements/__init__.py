"""What is said of a result: errors and floors, evidence, steps, and what stays open."""
