MODULE NACELLE_A
  ! NACELLE_A: 6 holes. Compiled by drillc: change the spec, not this file.

  PERS tooldata ee90:=[TRUE,[[-350.000,0.000,250.000],[0.70710678,0.00000000,-0.70710678,0.00000000]],[85.000,[-140.000,0.000,130.000],[1,0,0,0],0,0,0]];
  PERS wobjdata part_frame:=[FALSE,TRUE,"",[[-1500.000,3000.000,1500.000],[0.00000000,1.00000000,0.00000000,0.00000000]],[[0,0,0],[1,0,0,0]]];
  ! Where the tool stands before each hole, along its own z (into the part):
  !   standoff{1} drill6
  LOCAL CONST num standoff{1}:=[-100.000];

  ! Region upper
  CONST robtarget P1:=[[240.000,2379.000,-542.000],[0.02554726,0.11747544,0.00302312,-0.99274252],[0,0,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget P2:=[[240.000,2336.000,-542.000],[0.02312084,0.11890461,0.00276958,-0.99263259],[0,0,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];

  ! Region mid_upper
  CONST robtarget P4:=[[490.000,1723.000,-407.000],[0.63908954,0.25757364,-0.27091071,-0.67218135],[0,0,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget P5:=[[524.000,1728.000,-372.000],[0.62734038,0.28624766,-0.30063873,-0.65887987],[0,0,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];

  ! Region lower
  CONST robtarget P7:=[[588.000,1730.000,340.000],[0.62470645,-0.04401872,-0.77881803,-0.03530835],[0,0,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget P8:=[[571.000,1730.000,392.000],[0.56057101,-0.05349961,-0.82557757,-0.03632648],[0,0,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];

  PROC main()
    ConfJ\Off;
    ConfL\Off;
    ! Region upper, process drill6: P1 .. P2, 2 holes
    MoveJ RelTool(P1,0,0,standoff{1}),v100\V:=250.000,fine,ee90\WObj:=part_frame;
    drill6 P1,12.000; ! P1
    drill6 P2,12.000; ! P2
    ! Region mid_upper, process drill6: P4 .. P5, 2 holes
    MoveJ RelTool(P4,0,0,standoff{1}),v100\V:=250.000,fine,ee90\WObj:=part_frame;
    drill6 P4,12.000; ! P4
    drill6 P5,12.000; ! P5
    ! Region lower, process drill6: P7 .. P8, 2 holes
    MoveJ RelTool(P7,0,0,standoff{1}),v100\V:=250.000,fine,ee90\WObj:=part_frame;
    drill6 P7,12.000; ! P7
    drill6 P8,12.000; ! P8
  ENDPROC

  ! Process drill6 at one hole.
  ! hole: a point of the surface; tool z goes into the part. depth: mm into the part.
  PROC drill6(robtarget hole,num depth)
    VAR num bottom;
    VAR bool timeout;

    MoveL RelTool(hole,0,0,standoff{1}),v100\V:=250.000,fine,ee90\WObj:=part_frame;
    SetAO spindle_speed,3000.000; ! rpm
    SetDO spindle_on,1;
    WaitDI spindle_running,1\MaxTime:=5.000\TimeFlag:=timeout;
    IF timeout THEN
      MoveL RelTool(hole,0,0,standoff{1}),v100\V:=50.000,fine,ee90\WObj:=part_frame;
      SetDO spindle_on,0;
      SetAO spindle_speed,0;
      TPWrite "drill6: no signal spindle_running within 5.000 s";
      EXIT; ! for good: the program pointer is gone, and start does nothing
    ENDIF
    MoveL RelTool(hole,0,0,-2.000),v100\V:=50.000,fine,ee90\WObj:=part_frame;
    ! Pecks of at most 3.000 mm.
    bottom:=-2.000;
    WHILE bottom+3.000<depth-0.001 DO
      bottom:=bottom+3.000;
      MoveL RelTool(hole,0,0,bottom),v100\V:=5.000,fine,ee90\WObj:=part_frame;
      MoveL RelTool(hole,0,0,-2.000),v100\V:=50.000,fine,ee90\WObj:=part_frame;
      MoveL RelTool(hole,0,0,bottom-0.500),v100\V:=50.000,fine,ee90\WObj:=part_frame;
    ENDWHILE
    MoveL RelTool(hole,0,0,depth),v100\V:=5.000,fine,ee90\WObj:=part_frame;
    MoveL RelTool(hole,0,0,-2.000),v100\V:=50.000,fine,ee90\WObj:=part_frame;
    MoveL RelTool(hole,0,0,standoff{1}),v100\V:=50.000,fine,ee90\WObj:=part_frame;
    SetDO spindle_on,0;
    SetAO spindle_speed,0;
  ENDPROC
ENDMODULE
