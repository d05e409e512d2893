"""The report: tables and figures of the paper and our own, from the model (docs/reference/report.md)."""
