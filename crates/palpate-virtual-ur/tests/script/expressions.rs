//! Values of expressions.

use crate::common::value;

#[test]
fn expressions_have_their_values() {
    for (expression, expected) in [
        ("1 + 2 * 3", "7"),
        ("(1 + 2) * 3", "9"),
        ("2 - 3 - 4", "-5"),
        ("7 / 2", "3.5"),
        ("8 / 2", "4"),
        ("7 % 3", "1"),
        ("-7 % 3", "-1"),
        ("7.5 % 2", "1.5"),
        ("-2 * -3", "6"),
        ("1 + 0.5", "1.5"),
        ("1 < 2 and 2 < 3", "True"),
        ("1 < 2 and not 2 < 3", "False"),
        ("False or True xor True", "False"),
        ("not False and False", "False"),
        ("1 == 1.0", "True"),
        ("\"a\" == \"b\"", "False"),
        ("[1, 2] == [1, 2.0]", "True"),
        ("[1, 2] != [1]", "True"),
        ("True != False", "True"),
        ("[1, 2, 3][1]", "2"),
        ("[[1, 2], [3, 4]][1][0]", "3"),
        ("p[1, 2, 3, 0, 0, 0][2]", "3"),
        ("[1, 2] + [3, 4.5]", "[4, 6.5]"),
        ("[1, 2] - [3, 5]", "[-2, -3]"),
        ("2 * [1, 2]", "[2, 4]"),
        ("[1, 2] / 2", "[0.5, 1]"),
        ("-[1, -2]", "[-1, 2]"),
        ("0x1F", "31"),
        ("1e-3", "0.001"),
        ("floor(2.7) + ceil(2.1)", "5"),
        ("floor(-2.5)", "-3"),
        ("norm(-3)", "3"),
        ("norm([3, 4])", "5"),
        ("norm(p[2, 3, 6, 9, 9, 9])", "7"),
        ("sqrt(2) * sqrt(2)", "2"),
        ("pow(2, 10)", "1024"),
        ("log(2, 8)", "3"),
        ("atan2(1, -1)", "2.35619"),
        ("d2r(180)", "3.14159"),
        ("r2d(acos(0))", "90"),
        ("length([1, 2, 3])", "3"),
        ("length(make_list(4, 0))", "4"),
        ("normalize([0, 3, 4])", "[0, 0.6, 0.8]"),
        ("str_cat(\"a\", 1)", "a1"),
        ("str_len(\"abc\")", "3"),
        ("str_at(\"abc\", 1)", "b"),
        ("to_num(\"42\") + to_num(\"0.5\")", "42.5"),
        ("point_dist(p[1,2,3,0,0,0], p[1,5,7,0,0,0])", "5"),
        // A quarter turn about z carries x to y.
        ("pose_trans(p[0,0,0,0,0,d2r(90)], p[1,0,0,0,0,0])[1]", "1"),
        (
            "norm(pose_trans(p[1,2,3,0.1,0.2,0.3], pose_inv(p[1,2,3,0.1,0.2,0.3]))) < 0.0000001",
            "True",
        ),
        ("interpolate_pose(p[0,0,0,0,0,0], p[1,0,0,0,0,2], 0.25)[5]", "0.5"),
        ("pose_sub(p[3,0,0,0,0,1], p[1,0,0,0,0,0.25])", "p[2, 0, 0, 0, 0, 0.75]"),
    ] {
        assert_eq!(value(expression).as_deref(), Ok(expected), "{expression}");
    }
}

#[test]
fn wrong_expressions_name_line_and_reason() {
    for (expression, expected) in [
        ("2147483647 + 1", "integer overflow: integers have 32 bits"),
        ("1 / 0", "division by zero"),
        ("1 % 0", "division by zero"),
        ("1 + True", "cannot add an integer and a boolean"),
        ("\"a\" + \"b\"", "cannot add a string and a string"),
        ("[1] + [1, 2]", "cannot add a list and a list"),
        ("1 == \"1\"", "cannot compare an integer and a string"),
        ("1 and True", "cannot decide by an integer"),
        ("True and 1", "cannot decide by an integer"),
        ("not 1", "cannot apply not to an integer"),
        ("[1, 2][2]", "index 2 of a list with 2 elements"),
        ("[1, 2][-1]", "index -1 of a list with 2 elements"),
        ("[1, 2][0.0]", "cannot index with a float"),
        ("5[0]", "cannot index an integer"),
        ("nothing", "the variable nothing is used before it has a value"),
        ("nothing()", "nothing is no function: define it before, or check the spelling"),
        ("sqrt(-1)", "sqrt: -1 has no square root"),
        ("acos(2)", "acos: 2 is not in [-1, 1]"),
        ("sin()", "sin: f is missing"),
        ("sin(1, 2)", "sin: takes 1 arguments at most"),
        ("sin(g=1)", "sin: has no parameter g"),
        ("sin(1, f=1)", "sin: f is given twice"),
        ("p[1, 2]", "expected six elements, found 2 elements"),
        ("p[1, 2, 3, 4, 5, True]", "cannot make a pose of [1, 2, 3, 4, 5, True]"),
        ("floor(1e10)", "floor: 10000000000 fits no 32-bit integer"),
        ("force_mode(1)", "force_mode exists on a real controller but is not modelled here"),
        ("1 +", "expected an expression, found )"),
    ] {
        let expected = format!("line 2: {expected}");
        assert_eq!(value(expression), Err(expected), "{expression}");
    }
}
