"""Global localization from a right prior and from an ambiguous start, on the same logs."""
