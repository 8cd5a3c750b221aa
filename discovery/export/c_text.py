"""What differs between systems in the exported C source: how the input runs between its samples."""

from __future__ import annotations

__all__ = ["INPUT_AT", "INPUT_NODE", "POWER"]

#: Input at a fraction of a step that was taken, by whether it is a motion.
INPUT_AT = {
    True: """/* The moving input with its rate and acceleration at fraction f of a step. */
static void input_at(const @NAME@_piece *p, double f, double *input)
{
    moved(f, p->length, p->input[0], p->input[2], input);
}""",
    False: """/* The input at fraction f of a step: a parabola through start, middle and end, held beyond them. */
static void input_at(const @NAME@_piece *p, double f, double *input)
{
    const double g = f < 0.0 ? 0.0 : f > 1.0 ? 1.0 : f;
    const double bend = 2.0 * (p->input[0][0] - 2.0 * p->input[1][0] + p->input[2][0]);
    input[0] = p->input[0][0] + g * (p->input[2][0] - p->input[0][0] - (1.0 - g) * bend);
}""",
}
#: Input at a fraction of the interval between two samples.
INPUT_NODE = {
    True: """static void input_node(double f, double length, const double *a, const double *b, double *input)
{
    moved(f, length, a, b, input);
}""",
    False: """static void input_node(double f, double length, const double *a, const double *b, double *input)
{
    (void)length;
    input[0] = a[0] + f * (b[0] - a[0]);
}""",
}
#: Small powers as products, where there are some.
POWER = """static double power(double x, int n)
{
    double product = x;
    while (--n > 0) {
        product *= x;
    }
    return product;
}

"""
