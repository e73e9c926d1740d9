C     A nonlinear mode, and what the friction of a joint does to a
C     response, from Fortran 77.  Reads the names of the two cases and of
C     the table from the standard input; the lines written are those of
C     modes.c.
      PROGRAM MODES
      CHARACTER*200 FMODE, FRESP, FOUT
      READ (*, '(A)') FMODE
      READ (*, '(A)') FRESP
      READ (*, '(A)') FOUT
      OPEN (11, FILE=FOUT, STATUS='UNKNOWN')
      CALL TABLE (FMODE, 'mode/first_harmonic', 'omega',
     &   'mode/damping_ratio')
      CALL TABLE (FRESP, 'omega', 'amplitude',
     &   'sensitivity/largest/contact_mu')
      CLOSE (11)
      END

C     Run a case, and write three numbers of each point by their names in
C     a result file.  Points count from 1.
      SUBROUTINE TABLE (FCASE, NAME1, NAME2, NAME3)
      CHARACTER*(*) FCASE, NAME1, NAME2, NAME3
      INTEGER IH, ISTAT, N, K
      DOUBLE PRECISION VAL(3)
      CALL FWNEW (IH, ISTAT)
      CALL CHECK (IH, ISTAT, 'FWNEW')
      CALL FWLOAD (IH, FCASE, ISTAT)
      CALL CHECK (IH, ISTAT, FCASE)
      CALL FWRUN (IH, ISTAT)
      CALL CHECK (IH, ISTAT, 'FWRUN')
      CALL FWCNT (IH, 'points', N, ISTAT)
      CALL CHECK (IH, ISTAT, 'FWCNT')
      DO 10 K = 1, N
         CALL FWGET (IH, NAME1, K, 1, VAL(1), ISTAT)
         CALL CHECK (IH, ISTAT, NAME1)
         CALL FWGET (IH, NAME2, K, 1, VAL(2), ISTAT)
         CALL CHECK (IH, ISTAT, NAME2)
         CALL FWGET (IH, NAME3, K, 1, VAL(3), ISTAT)
         CALL CHECK (IH, ISTAT, NAME3)
         WRITE (11, '(1P,3E26.17E3)') VAL
   10 CONTINUE
      CALL FWFREE (IH, ISTAT)
      END

      SUBROUTINE CHECK (IH, ISTAT, WHAT)
      INTEGER IH, ISTAT
      CHARACTER*(*) WHAT
      CHARACTER*500 TEXT
      IF (ISTAT .EQ. 0) RETURN
      CALL FWMSG (IH, TEXT)
      WRITE (*, *) WHAT, ': status ', ISTAT, ' ', TEXT
      STOP 1
      END
