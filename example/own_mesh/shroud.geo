// One of twelve sectors of a disk with a shrouded blade (mm), quadratic tetrahedra; the shroud
// touches those of its neighbours, with more nodes on one side.
SetFactory("OpenCASCADE");
a = Pi / 12;
Macro Part
  Cylinder(v) = {0, 0, 0, 0, 0, 6, outer, 2 * half};
  Cylinder(v + 1) = {0, 0, -1, 0, 0, 8, inner, 2 * Pi};
  BooleanDifference(v + 2) = { Volume{v}; Delete; }{ Volume{v + 1}; Delete; };
  Rotate { {0, 0, 1}, {0, 0, 0}, -half } { Volume{v + 2}; }
Return
v = 1;   inner = 20;  outer = 40;  half = a;      Call Part;
v = 11;  inner = 40;  outer = 60;  half = a / 3;  Call Part;
v = 21;  inner = 60;  outer = 66;  half = a;      Call Part;
BooleanUnion(31) = { Volume{3}; Delete; }{ Volume{13, 23}; Delete; };

// Both cut faces of the disk have the same nodes.
left[] = Surface In BoundingBox {19, -11, -1, 39, -5, 7};
right[] = Surface In BoundingBox {19, 5, -1, 39, 11, 7};
Periodic Surface {right[0]} = {left[0]} Rotate { {0, 0, 1}, {0, 0, 0}, 2 * a };

one[] = Surface In BoundingBox {57, 15, -1, 64, 18, 7};
two[] = Surface In BoundingBox {57, -18, -1, 64, -15, 7};
Physical Volume("DISK") = {31};
Physical Surface("BORE") = Surface In BoundingBox {19, -5.5, -1, 21, 5.5, 7};
Physical Surface("SHROUD_1") = {one[0]};
Physical Surface("SHROUD_2") = {two[0]};
Physical Point("TIP") = Point In BoundingBox {63, 17, 5, 64, 18, 7};

Mesh.CharacteristicLengthMax = 8;
MeshSize { PointsOf{ Surface{one[0]}; } } = 3.5;
Mesh.ElementOrder = 2;
