//! Words to statements. Indentation means nothing; `end` closes what `:` opens.

use super::ast::{Expression, Function, FunctionKind, Line, Node, Scope, Statement};
use super::error::{ErrorKind, ScriptError};
use super::lexer::{Token, Word, lex};

pub(crate) struct Parser {
    tokens: Vec<Token>,
    next: usize,
    pub(crate) depth: usize,
    /// Operators in the present statement.
    links: usize,
}

/// Operators in one statement: `1+1+…` makes a tree as deep as it is long.
const LINKS_MAX: usize = 1000;

/// Words that are no names.
const RESERVED: &[&str] = &[
    "and",
    "break",
    "continue",
    "def",
    "elif",
    "else",
    "end",
    "enter_critical",
    "exit_critical",
    "False",
    "global",
    "halt",
    "if",
    "join",
    "kill",
    "local",
    "not",
    "or",
    "pass",
    "return",
    "run",
    "sec",
    "thread",
    "True",
    "while",
    "xor",
];

/// The statements of `text`.
pub(crate) fn parse(text: &str) -> Result<Vec<Line>, ScriptError> {
    let mut parser = Parser { tokens: lex(text)?, next: 0, depth: 0, links: 0 };
    let lines = parser.block(&[])?;
    match parser.peek() {
        Word::End => Ok(lines),
        _ => Err(parser.unexpected("a statement")),
    }
}

impl Parser {
    pub(crate) fn peek(&self) -> &Word {
        // The last token is the end, and nothing steps over it.
        self.tokens.get(self.next).map_or(&Word::End, |t| &t.word)
    }

    pub(crate) fn line(&self) -> u32 {
        self.tokens.get(self.next).or(self.tokens.last()).map_or(1, |t| t.line)
    }

    pub(crate) fn advance(&mut self) -> Word {
        let word = self.peek().clone();
        if word != Word::End {
            self.next += 1;
        }
        word
    }

    pub(crate) fn unexpected(&self, expected: &'static str) -> ScriptError {
        ErrorKind::Syntax { expected, found: self.peek().to_string() }.at(self.line())
    }

    pub(crate) fn sign(&mut self, sign: &'static str) -> bool {
        let found = matches!(self.peek(), Word::Sign(s) if *s == sign);
        self.next += usize::from(found);
        found
    }

    pub(crate) fn expect(&mut self, sign: &'static str) -> Result<(), ScriptError> {
        if self.sign(sign) { Ok(()) } else { Err(self.unexpected(sign)) }
    }

    pub(crate) fn is_keyword(&self, keyword: &str) -> bool {
        matches!(self.peek(), Word::Name(name) if name == keyword)
    }

    pub(crate) fn keyword(&mut self, keyword: &str) -> bool {
        let found = self.is_keyword(keyword);
        self.next += usize::from(found);
        found
    }

    /// Whether a word is no keyword.
    pub(crate) fn is_free(word: &str) -> bool {
        !RESERVED.contains(&word)
    }

    /// A name that is no keyword.
    pub(crate) fn name(&mut self) -> Result<String, ScriptError> {
        match self.peek() {
            Word::Name(name) if Self::is_free(name) => {
                let name = name.clone();
                self.next += 1;
                Ok(name)
            }
            _ => Err(self.unexpected("a name")),
        }
    }

    /// Whether the word after the next one is `sign`.
    fn sign_follows(&self, sign: &str) -> bool {
        matches!(self.tokens.get(self.next + 1), Some(Token { word: Word::Sign(s), .. }) if *s == sign)
    }

    /// Statements until one of `closers` or the end of the text; the closer stays.
    fn block(&mut self, closers: &[&str]) -> Result<Vec<Line>, ScriptError> {
        let mut lines = Vec::new();
        loop {
            while *self.peek() == Word::Newline {
                self.next += 1;
            }
            if *self.peek() == Word::End || closers.iter().any(|c| self.is_keyword(c)) {
                return Ok(lines);
            }
            let line = self.line();
            lines.push(Line { statement: self.statement()?, line });
        }
    }

    /// A block after `:` that `end` closes, or one of `also`, which stays.
    fn body(&mut self, also: &[&str]) -> Result<Vec<Line>, ScriptError> {
        self.deeper()?;
        self.expect(":")?;
        let closers: Vec<&str> = also.iter().copied().chain(["end"]).collect();
        let lines = self.block(&closers)?;
        self.depth -= 1;
        if also.iter().any(|c| self.is_keyword(c)) || self.keyword("end") {
            return Ok(lines);
        }
        Err(self.unexpected("end"))
    }

    pub(crate) fn deeper(&mut self) -> Result<(), ScriptError> {
        self.depth += 1;
        if self.depth > ErrorKind::DEPTH_MAX {
            return Err(ErrorKind::TooDeep.at(self.line()));
        }
        Ok(())
    }

    pub(crate) fn link(&mut self) -> Result<(), ScriptError> {
        self.links += 1;
        if self.links > LINKS_MAX {
            return Err(ErrorKind::TooLarge("over 1000 operators in a statement").at(self.line()));
        }
        Ok(())
    }

    fn statement(&mut self) -> Result<Statement, ScriptError> {
        self.links = 0;
        let statement = self.unfinished_statement()?;
        // Controllers take the next statement on the same line: control programs in the field rely on it.
        match self.peek() {
            Word::Newline | Word::End | Word::Name(_) => Ok(statement),
            _ => Err(self.unexpected("the end of the line")),
        }
    }

    fn unfinished_statement(&mut self) -> Result<Statement, ScriptError> {
        let word = match self.peek().clone() {
            Word::Name(word) => word,
            // A variable may be called p: no statement begins with a pose.
            Word::PoseOpen => return self.assignment(Scope::Free),
            _ => return Err(self.unexpected("a statement")),
        };
        let simple = match word.as_str() {
            "def" => return self.function(FunctionKind::Function),
            "thread" => return self.function(FunctionKind::Thread),
            "sec" => return self.function(FunctionKind::Secondary),
            "if" => return self.conditional(),
            "while" => {
                self.next += 1;
                let condition = self.expression()?;
                return Ok(Statement::While { condition, body: self.body(&[])? });
            }
            "global" => return self.declaration(Scope::Global),
            "local" => return self.declaration(Scope::Local),
            "return" => {
                self.next += 1;
                let bare =
                    matches!(self.peek(), Word::Newline | Word::End) || self.is_keyword("end");
                return Ok(Statement::Return(if bare { None } else { Some(self.expression()?) }));
            }
            "kill" => {
                self.next += 1;
                return Ok(Statement::Kill(self.expression()?));
            }
            "join" => {
                self.next += 1;
                return Ok(Statement::Join(self.expression()?));
            }
            "break" => Statement::Break,
            "continue" => Statement::Continue,
            "halt" => Statement::Halt,
            "pass" => Statement::Pass,
            "enter_critical" => Statement::EnterCritical,
            "exit_critical" => Statement::ExitCritical,
            _ if self.sign_follows("=") || self.sign_follows("[") => {
                return self.assignment(Scope::Free);
            }
            _ => return self.call_statement(),
        };
        self.next += 1;
        Ok(simple)
    }

    fn declaration(&mut self, scope: Scope) -> Result<Statement, ScriptError> {
        self.next += 1;
        self.assignment(scope)
    }

    fn assignment(&mut self, scope: Scope) -> Result<Statement, ScriptError> {
        let mut indices = Vec::new();
        let name = if *self.peek() == Word::PoseOpen {
            self.next += 1;
            indices.push(self.expression()?);
            self.expect("]")?;
            "p".to_owned()
        } else {
            self.name()?
        };
        while self.sign("[") {
            indices.push(self.expression()?);
            self.expect("]")?;
        }
        self.expect("=")?;
        Ok(Statement::Assign { scope, name, indices, value: self.expression()? })
    }

    fn call_statement(&mut self) -> Result<Statement, ScriptError> {
        let node = self.expression()?;
        match &node.expression {
            Expression::Call(_) | Expression::Run(_) => Ok(Statement::Call(node)),
            _ => Err(ErrorKind::Syntax {
                expected: "an assignment or a call",
                found: "an expression without effect".into(),
            }
            .at(node.line)),
        }
    }

    fn conditional(&mut self) -> Result<Statement, ScriptError> {
        let mut arms = Vec::new();
        loop {
            // Over `if` or `elif`.
            self.next += 1;
            let condition = self.expression()?;
            arms.push((condition, self.body(&["elif", "else"])?));
            if self.is_keyword("elif") {
                continue;
            }
            let otherwise = if self.keyword("else") { self.body(&[])? } else { Vec::new() };
            return Ok(Statement::If { arms, otherwise });
        }
    }

    fn function(&mut self, kind: FunctionKind) -> Result<Statement, ScriptError> {
        let line = self.line();
        self.next += 1;
        let name = self.name()?;
        self.expect("(")?;
        let mut parameters: Vec<(String, Option<Node>)> = Vec::new();
        while !self.sign(")") {
            if !parameters.is_empty() {
                self.expect(",")?;
            }
            let parameter = self.name()?;
            let default = if self.sign("=") { Some(self.expression()?) } else { None };
            parameters.push((parameter, default));
        }
        let body = self.body(&[])?;
        Ok(Statement::Function(Function { kind, name, parameters, body, line }))
    }
}
