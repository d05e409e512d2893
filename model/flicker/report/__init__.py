"""The report: tables and figures of the paper and our own, from the model (docs/guide/report.md)."""
