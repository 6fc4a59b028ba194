"""Post-mortems of many logs on one machine or many, and a folder that is watched for new ones."""
