C     A namelist that is checked, run as a whole and then made wrong,
C     from Fortran 77.  Reads its name from the standard input; writes a
C     line for every call: what it was, its status and its answer.
      PROGRAM WHOLE
      INTEGER IH, ISTAT, N
      CHARACTER*300 PATH, TEXT

      READ (*, '(A)') PATH
      CALL FWNEW (IH, ISTAT)
      CALL FWLOAD (IH, PATH, ISTAT)
      CALL LINE ('load', ISTAT, ' ')
      CALL FWSET (IH, 'sweep%n_points', '3', ISTAT)
      CALL FWCHK (IH, ISTAT)
      CALL LINE ('check', ISTAT, ' ')
      CALL FWRUN (IH, ISTAT)
      CALL LINE ('run', ISTAT, ' ')
      CALL FWCNT (IH, 'points', N, ISTAT)
      WRITE (TEXT, '(I1)') N
      CALL LINE ('points', ISTAT, TEXT)
      CALL FWTEXT (IH, 'title', 0, TEXT, ISTAT)
      CALL LINE ('title', ISTAT, TEXT)
      TEXT = 'as it was'
      CALL FWTEXT (IH, 'titel', 0, TEXT, ISTAT)
      CALL LINE ('no such text', ISTAT, TEXT)
      CALL FWSET (IH, 'contact%mu', '-1', ISTAT)
      CALL FWCHK (IH, ISTAT)
      CALL FWMSG (IH, TEXT)
      CALL LINE ('wrong', ISTAT, TEXT)
      CALL FWLOAD (IH, '/does/not/exist.nml', ISTAT)
      CALL FWMSG (IH, TEXT)
      CALL LINE ('no such file', ISTAT, TEXT)
      CALL FWFREE (IH, ISTAT)
      END

      SUBROUTINE LINE (LABEL, ISTAT, TEXT)
      CHARACTER*(*) LABEL, TEXT
      INTEGER ISTAT
      WRITE (*, '(2A, I1, 2A)') LABEL, CHAR(9), ISTAT, CHAR(9), TEXT
      END
