C     Frequency response of a blade sector, frequency by frequency, from
C     Fortran 77.  Reads the name of the model, that of the result and
C     the number of points after which to stop (0: none) from the
C     standard input.  The lines written are those of frf.c.
      PROGRAM FRF
      INTEGER NDMAX, NPMAX
      PARAMETER (NDMAX = 100, NPMAX = 32)
      INTEGER NREAL, NDOF, NPAIR, IH, ISTAT, I, J, K, N, NPTS, NSTOP
      DOUBLE PRECISION VAL(NDMAX*NDMAX), OMEGA
      INTEGER NSIDE(3*NPMAX)
      CHARACTER*20 NAME(12)
      CHARACTER*200 FMODEL, FOUT, TEXT
      COMMON /CONTRL/ NSTOP
      EXTERNAL PROG
      DATA NREAL /10/
      DATA NAME /'mass', 'stiffness', 'stiffness_rotation',
     &   'load/static', 'load/static_rotation', 'load/cosine',
     &   'load/sine', 'contact/mu', 'contact/gap', 'contact/area',
     &   'contact/side_1', 'contact/side_2'/

      READ (*, '(A)') FMODEL
      READ (*, '(A)') FOUT
      READ (*, *) NSTOP
      CALL FWVERS (TEXT)
      WRITE (*, *) 'Fretwear ', TEXT(1:10)

C     The model of this program goes into the library part by part.
      CALL FWNEW (IH, ISTAT)
      CALL CHECK (IH, ISTAT, 'FWNEW')
      OPEN (10, FILE=FMODEL, STATUS='OLD')
      READ (10, *) NDOF, NPAIR
      IF (NDOF .GT. NDMAX .OR. NPAIR .GT. NPMAX) STOP 'TOO LARGE'
      CALL FWMODL (IH, NDOF, NPAIR, ISTAT)
      CALL CHECK (IH, ISTAT, 'FWMODL')
      DO 10 I = 1, NREAL
         N = NPAIR
         IF (I .LE. 7) N = NDOF
         IF (I .LE. 3) N = NDOF*NDOF
         READ (10, *) (VAL(J), J = 1, N)
         CALL FWPUTD (IH, NAME(I), N, VAL, ISTAT)
         CALL CHECK (IH, ISTAT, NAME(I))
   10 CONTINUE
      DO 20 I = 11, 12
         READ (10, *) (NSIDE(J), J = 1, 3*NPAIR)
         CALL FWPUTI (IH, NAME(I), 3*NPAIR, NSIDE, ISTAT)
         CALL CHECK (IH, ISTAT, NAME(I))
   20 CONTINUE
      READ (10, *) (VAL(J), J = 1, NDOF)
      CALL FWOBS (IH, 'tip', NDOF, VAL, ISTAT)
      CALL CHECK (IH, ISTAT, 'FWOBS')
      CLOSE (10)

C     Keys by their names in the namelist.
      CALL FWSETD (IH, 'model%modal_damping', 1.0D-3, ISTAT)
      CALL CHECK (IH, ISTAT, 'modal_damping')
      CALL FWSETD (IH, 'model%rotation_speed', 460.8D0, ISTAT)
      CALL CHECK (IH, ISTAT, 'rotation_speed')
      CALL FWSET (IH, 'contact%law', 'dlft', ISTAT)
      CALL CHECK (IH, ISTAT, 'law')
      CALL FWSETD (IH, 'load%harmonic_scale', 0.5D0, ISTAT)
      CALL CHECK (IH, ISTAT, 'harmonic_scale')
      CALL FWSETI (IH, 'harmonics%n_harmonics', 3, ISTAT)
      CALL CHECK (IH, ISTAT, 'n_harmonics')
      CALL FWSETI (IH, 'harmonics%n_time', 128, ISTAT)
      CALL CHECK (IH, ISTAT, 'n_time')
      CALL FWSET (IH, 'sweep%unit', 'Hz', ISTAT)
      CALL CHECK (IH, ISTAT, 'unit')
      CALL FWSETD (IH, 'sweep%start', 1017.0D0, ISTAT)
      CALL CHECK (IH, ISTAT, 'start')
      CALL FWSETD (IH, 'sweep%end', 1029.0D0, ISTAT)
      CALL CHECK (IH, ISTAT, 'end')
      CALL FWSETI (IH, 'sweep%n_points', 25, ISTAT)
      CALL CHECK (IH, ISTAT, 'n_points')
      CALL FWPROG (IH, PROG, ISTAT)
      CALL CHECK (IH, ISTAT, 'FWPROG')

C     Step by step.
      OPEN (11, FILE=FOUT, STATUS='UNKNOWN')
      CALL FWSTRT (IH, ISTAT)
      CALL CHECK (IH, ISTAT, 'FWSTRT')
      CALL FWCNT (IH, 'frequencies', NPTS, ISTAT)
      CALL CHECK (IH, ISTAT, 'FWCNT')
      DO 30 K = 1, NPTS
         CALL FWFREQ (IH, K, OMEGA, ISTAT)
         CALL CHECK (IH, ISTAT, 'FWFREQ')
         CALL FWSOLV (IH, OMEGA, ISTAT)
C        4: not converged, 6: stopped; the point is there all the same.
         IF (ISTAT .NE. 4 .AND. ISTAT .NE. 6)
     &      CALL CHECK (IH, ISTAT, 'FWSOLV')
         CALL PRINT (IH, 'omega')
         CALL PRINT (IH, 'converged')
         CALL PRINT (IH, 'amplitude')
         CALL PRINT (IH, 'coefficients')
         CALL PRINT (IH, 'contact/force')
         CALL PRINT (IH, 'contact/fraction')
         CALL PRINT (IH, 'contact/dissipation')
         IF (ISTAT .EQ. 6) GOTO 40
   30 CONTINUE
   40 CLOSE (11)
      CALL FWFREE (IH, I)
      IF (ISTAT .EQ. 6) STOP 6
      END

C     The last point's values of a name, one a line.
      SUBROUTINE PRINT (IH, NAME)
      INTEGER IH, N, I, ISTAT
      CHARACTER*(*) NAME
      DOUBLE PRECISION VAL(2000)
      CALL FWSIZE (IH, NAME, 0, N, ISTAT)
      CALL CHECK (IH, ISTAT, NAME)
      CALL FWGET (IH, NAME, 0, 2000, VAL, ISTAT)
      CALL CHECK (IH, ISTAT, NAME)
      WRITE (11, '(1P,E26.17E3)') (VAL(I), I = 1, N)
      END

C     Called by the library after every point.
      SUBROUTINE PROG (IH, K, N, OMEGA, ICONV, ISTOP)
      INTEGER IH, K, N, ICONV, ISTOP, NSTOP
      DOUBLE PRECISION OMEGA
      COMMON /CONTRL/ NSTOP
      WRITE (*, '(A,I4,A,F10.3,A,I2)') ' point', K, ': ', OMEGA,
     &   ' rad/s, converged ', ICONV
      IF (NSTOP .GT. 0 .AND. K .GE. NSTOP) ISTOP = 1
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
