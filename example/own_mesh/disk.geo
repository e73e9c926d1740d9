// One of twelve sectors of a disk: bore 20, rim 60, thickness 5 (mm), quadratic hexahedra.
a = Pi / 12;
Point(1) = {0, 0, 0};
Point(2) = {20 * Cos(-a), 20 * Sin(-a), 0};  Point(3) = {60 * Cos(-a), 60 * Sin(-a), 0};
Point(4) = {60, 0, 0};
Point(5) = {60 * Cos(a), 60 * Sin(a), 0};    Point(6) = {20 * Cos(a), 20 * Sin(a), 0};
Point(7) = {20, 0, 0};
Line(1) = {2, 3};  Circle(2) = {3, 1, 4};  Circle(3) = {4, 1, 5};  Line(4) = {5, 6};
Circle(5) = {6, 1, 7};  Circle(6) = {7, 1, 2};  Line(7) = {7, 4};
Curve Loop(1) = {1, 2, -7, 6};  Plane Surface(1) = {1};
Curve Loop(2) = {7, 3, 4, 5};   Plane Surface(2) = {2};
Transfinite Curve {1, 4, 7} = 5;  Transfinite Curve {2, 3, 5, 6} = 3;
Transfinite Surface {1, 2};  Recombine Surface {1, 2};
body[] = Extrude {0, 0, 5} { Surface{1, 2}; Layers{1}; Recombine; };

Physical Volume("DISK") = Volume{:};
Physical Surface("BORE") = Surface In BoundingBox {15, -10, -1, 21, 10, 6};
Physical Point("TIP") = Point In BoundingBox {59, -1, 4, 61, 1, 6};

Mesh.ElementOrder = 2;
Mesh.SecondOrderIncomplete = 1;
Mesh.SaveGroupsOfNodes = 1;
