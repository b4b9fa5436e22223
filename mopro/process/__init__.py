"""What processes of mopro share: libraries loaded safely, compiled code, work on several cores."""
