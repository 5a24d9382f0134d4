//! Words to expressions, by precedence: or/xor, and, not, comparison, sum, product, sign, index.

use super::ast::{Binary, Call, Expression, Node, Unary};
use super::error::ScriptError;
use super::lexer::Word;
use super::parser::Parser;
use super::value::Value;

const COMPARISONS: &[(&str, Binary)] = &[
    ("==", Binary::Equal),
    ("!=", Binary::NotEqual),
    ("<=", Binary::LessEqual),
    (">=", Binary::GreaterEqual),
    ("<", Binary::Less),
    (">", Binary::Greater),
];
const SUMS: &[(&str, Binary)] = &[("+", Binary::Add), ("-", Binary::Subtract)];
const PRODUCTS: &[(&str, Binary)] =
    &[("*", Binary::Multiply), ("/", Binary::Divide), ("%", Binary::Remainder)];

type Rule = fn(&mut Parser) -> Result<Node, ScriptError>;

impl Parser {
    pub(crate) fn expression(&mut self) -> Result<Node, ScriptError> {
        self.deeper()?;
        let mut left = self.conjunction()?;
        loop {
            let line = self.line();
            let expression = if self.keyword("or") {
                Expression::Or(Box::new(left), Box::new(self.conjunction()?))
            } else if self.keyword("xor") {
                Expression::Binary(Binary::Xor, Box::new(left), Box::new(self.conjunction()?))
            } else {
                self.depth -= 1;
                return Ok(left);
            };
            self.link()?;
            left = Node { expression, line };
        }
    }

    fn conjunction(&mut self) -> Result<Node, ScriptError> {
        let mut left = self.negation()?;
        loop {
            let line = self.line();
            if !self.keyword("and") {
                return Ok(left);
            }
            let right = self.negation()?;
            self.link()?;
            left = Node { expression: Expression::And(Box::new(left), Box::new(right)), line };
        }
    }

    fn negation(&mut self) -> Result<Node, ScriptError> {
        let line = self.line();
        if !self.keyword("not") {
            return self
                .binary(COMPARISONS, |p| p.binary(SUMS, |p| p.binary(PRODUCTS, Self::signed)));
        }
        self.deeper()?;
        let operand = self.negation()?;
        self.depth -= 1;
        Ok(Node { expression: Expression::Unary(Unary::Not, Box::new(operand)), line })
    }

    /// Left-associative operators of one precedence.
    fn binary(
        &mut self,
        operators: &[(&'static str, Binary)],
        next: Rule,
    ) -> Result<Node, ScriptError> {
        let mut left = next(self)?;
        loop {
            let line = self.line();
            let Some((_, operator)) = operators.iter().find(|(sign, _)| self.sign(sign)) else {
                return Ok(left);
            };
            let right = next(self)?;
            self.link()?;
            let expression = Expression::Binary(*operator, Box::new(left), Box::new(right));
            left = Node { expression, line };
        }
    }

    fn signed(&mut self) -> Result<Node, ScriptError> {
        let line = self.line();
        if self.sign("+") {
            return self.signed_deeper();
        }
        if !self.sign("-") {
            return self.indexed();
        }
        let operand = self.signed_deeper()?;
        Ok(Node { expression: Expression::Unary(Unary::Minus, Box::new(operand)), line })
    }

    fn signed_deeper(&mut self) -> Result<Node, ScriptError> {
        self.deeper()?;
        let operand = self.signed()?;
        self.depth -= 1;
        Ok(operand)
    }

    fn indexed(&mut self) -> Result<Node, ScriptError> {
        let mut node = self.atom()?;
        loop {
            let line = self.line();
            if !self.sign("[") {
                return Ok(node);
            }
            let index = self.expression()?;
            self.expect("]")?;
            self.link()?;
            node = Node { expression: Expression::Index(Box::new(node), Box::new(index)), line };
        }
    }

    fn atom(&mut self) -> Result<Node, ScriptError> {
        // Where a value must follow, a line may end before it: as above.
        while *self.peek() == Word::Newline {
            self.advance();
        }
        let line = self.line();
        let expression = match self.peek().clone() {
            Word::Int(i) => self.constant(Value::Int(i)),
            Word::Float(x) => self.constant(Value::Float(x)),
            Word::Text(text) => self.constant(Value::Text(text)),
            Word::Sign("(") => {
                self.advance();
                let inner = self.expression()?;
                self.expect(")")?;
                return Ok(inner);
            }
            Word::Sign("[") => {
                self.advance();
                Expression::List(self.elements()?)
            }
            Word::PoseOpen => {
                self.advance();
                let mut elements = self.elements()?;
                // One element is an index into a variable called p.
                match (elements.pop(), elements.is_empty()) {
                    (Some(index), true) => {
                        let p = Node { expression: Expression::Variable("p".into()), line };
                        Expression::Index(Box::new(p), Box::new(index))
                    }
                    (last, _) => {
                        elements.extend(last);
                        Expression::Pose(elements)
                    }
                }
            }
            Word::Name(name) => match name.as_str() {
                "True" => self.constant(Value::Bool(true)),
                "False" => self.constant(Value::Bool(false)),
                "run" => {
                    self.advance();
                    let thread = self.name()?;
                    self.expect("(")?;
                    self.expect(")")?;
                    Expression::Run(thread)
                }
                _ if !Self::is_free(&name) => return Err(self.unexpected("an expression")),
                _ => {
                    self.advance();
                    if self.sign("(") {
                        Expression::Call(Call { function: name, arguments: self.arguments()? })
                    } else {
                        Expression::Variable(name)
                    }
                }
            },
            _ => return Err(self.unexpected("an expression")),
        };
        Ok(Node { expression, line })
    }

    fn constant(&mut self, value: Value) -> Expression {
        self.advance();
        Expression::Constant(value)
    }

    /// Expressions up to `]`.
    fn elements(&mut self) -> Result<Vec<Node>, ScriptError> {
        let mut elements = Vec::new();
        while !self.sign("]") {
            if !elements.is_empty() {
                self.expect(",")?;
            }
            elements.push(self.expression()?);
        }
        Ok(elements)
    }

    /// Arguments up to `)`; those without a name first.
    fn arguments(&mut self) -> Result<Vec<(Option<String>, Node)>, ScriptError> {
        let mut arguments: Vec<(Option<String>, Node)> = Vec::new();
        while !self.sign(")") {
            if !arguments.is_empty() {
                self.expect(",")?;
            }
            let node = self.expression()?;
            let argument = match node.expression {
                Expression::Variable(name) if self.sign("=") => (Some(name), self.expression()?),
                _ if arguments.last().is_some_and(|(name, _)| name.is_some()) => {
                    return Err(self.unexpected("name=value after an argument by name"));
                }
                expression => (None, Node { expression, line: node.line }),
            };
            arguments.push(argument);
        }
        Ok(arguments)
    }
}
